//! The text at the beginning of an array of numpy, before it is parsed as what it may be: any Python literal.
//!
//! Numpy writes a single form, a dictionary of three entries without anything nested but the tuple of the shape. A
//! parser of literals tries each bracket more than one way, so a few nested ones keep it busy for hours, and deep ones
//! overflow the stack. Whatever has another form is therefore refused here.

/// Most bytes of the text that describes an array; numpy writes about 120.
pub(super) const ARRAY_HEADER_BYTES_MAX: usize = 4096;
/// Most dimensions of an array that is read further: a mask has three.
const DIMENSIONS_MAX: usize = 8;
/// Most digits of a dimension.
const DIGITS_MAX: usize = 12;
const NO_ARRAY: &str = "is not an array of numpy";

/// Refuses bytes that do not begin like an array of plain values, as numpy writes it.
///
/// # Errors
/// A clause after the array's name.
pub(super) fn check(bytes: &[u8]) -> Result<(), String> {
    let text = text(bytes).ok_or(NO_ARRAY)?;
    let mut literal = Literal { rest: text.trim_end() };
    let found = literal.entries().ok_or(NO_ARRAY)?;
    if found.is_record {
        return Err("is an array of records; save it as a column of numbers".to_owned());
    }
    // Sizes are multiplied later, in 64 bits.
    if found.shape.iter().try_fold(16_u64, |product, &length| product.checked_mul(length.max(1))).is_none() {
        return Err(format!("has an absurd shape ({}); save it again", text_of_shape(&found.shape)));
    }
    Ok(())
}

fn text_of_shape(shape: &[u64]) -> String {
    shape.iter().map(u64::to_string).collect::<Vec<_>>().join("x")
}

/// The text that describes an array.
fn text(bytes: &[u8]) -> Option<&str> {
    let version = *bytes.get(6)?;
    let after_version = bytes.get(8..)?;
    let (length, rest) = if version == 1 {
        let (length, rest) = after_version.split_first_chunk()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = after_version.split_first_chunk()?;
        (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
    };
    let text = rest.get(..length).filter(|_| length <= ARRAY_HEADER_BYTES_MAX)?;
    std::str::from_utf8(text).ok()
}

/// What the text says of an array.
#[derive(Debug, Default, PartialEq, Eq)]
struct Described {
    shape: Vec<u64>,
    /// Whether the type is a list, which numpy writes for records.
    is_record: bool,
}

/// A text that is read from its beginning.
struct Literal<'a> {
    rest: &'a str,
}

impl<'a> Literal<'a> {
    /// The dictionary, which must be all that there is; a list for a type ends it.
    fn entries(&mut self) -> Option<Described> {
        let mut found = Described::default();
        self.sign('{')?;
        while self.sign('}').is_none() {
            let key = self.quoted()?;
            self.sign(':')?;
            match key {
                "descr" if self.sees('[') => return Some(Described { is_record: true, ..found }),
                "descr" => drop(self.quoted()?),
                "fortran_order" => self.truth()?,
                "shape" => found.shape = self.shape()?,
                _ => return None,
            }
            if self.sign(',').is_none() && !self.sees('}') {
                return None;
            }
        }
        self.rest.is_empty().then_some(found)
    }

    fn sees(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start_matches([' ', '\t']);
        self.rest.starts_with(sign)
    }

    fn sign(&mut self, sign: char) -> Option<()> {
        self.rest = self.sees(sign).then(|| &self.rest[sign.len_utf8()..])?;
        Some(())
    }

    /// A string without any backslash.
    fn quoted(&mut self) -> Option<&'a str> {
        let quote = ['\'', '"'].into_iter().find(|&quote| self.sees(quote))?;
        let (text, rest) = self.rest[1..].split_once(quote)?;
        self.rest = rest;
        (!text.contains('\\')).then_some(text)
    }

    fn truth(&mut self) -> Option<()> {
        let word = ["True", "False"].into_iter().find(|word| self.rest.trim_start().starts_with(word))?;
        self.rest = &self.rest.trim_start()[word.len()..];
        Some(())
    }

    fn shape(&mut self) -> Option<Vec<u64>> {
        let mut shape = Vec::new();
        self.sign('(')?;
        while self.sign(')').is_none() {
            let length = self.rest.trim_start().bytes().take_while(u8::is_ascii_digit).count();
            self.rest = self.rest.trim_start();
            shape.push(self.rest.get(..length).filter(|digits| digits.len() <= DIGITS_MAX)?.parse().ok()?);
            self.rest = &self.rest[length..];
            if shape.len() > DIMENSIONS_MAX || self.sign(',').is_none() && !self.sees(')') {
                return None;
            }
        }
        Some(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(text: &str) -> Option<Described> {
        Literal { rest: text.trim_end() }.entries()
    }

    #[test]
    fn the_forms_that_numpy_writes_are_read() {
        for (text, shape) in [
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (500,), }   \n", &[500][..]),
            ("{'descr': '|u1', 'fortran_order': True, 'shape': (256, 256, 2)}\n", &[256, 256, 2]),
            ("{\"shape\":(), \"descr\":\">i8\", \"fortran_order\":False}", &[]),
        ] {
            assert_eq!(described(text), Some(Described { shape: shape.to_vec(), is_record: false }), "{text}");
        }
        let records = "{'descr': [('a', '<f4'), ('b', '<i8')], 'fortran_order': False, 'shape': (2,), }";
        assert!(described(records).is_some_and(|found| found.is_record));
    }

    #[test]
    fn no_other_literal_is() {
        for text in [
            "",
            "{",
            "}",
            "[[[[[[]]]]]]",
            "{'shape': ((1,),), }",
            "{'shape': [1], }",
            "{'shape': (1 2), }",
            "{'shape': (1,), } {}",
            "{'shape': (-1,), }",
            "{'shape': (1e3,), }",
            "{'shape': (99999999999999999999,), }",
            "{'shape': (1,1,1,1,1,1,1,1,1), }",
            "{'descr': ('<f4',), }",
            "{'descr': '\\x41', }",
            "{'descr' '<f4', }",
            "{'fortran_order': None, }",
            "{'fortran_order': {{{{}}}}, }",
            "{{}: 1}",
            "{'other': 1}",
        ] {
            assert_eq!(described(text), None, "{text}");
        }
    }
}
