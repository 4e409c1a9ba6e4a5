//! Tables of numbers that a device reads as the host does. A row of a table in [`super::rules`] is all there is to a
//! rule: from it follow the field, its default, its place among the words that cross to the device, and its member of
//! the struct in GLSL.

/// A value that crosses to a device as words of 32 bits: a number, an array, or a struct of such.
pub trait Numbers {
    /// The type in GLSL; of an array, that of its elements.
    const GLSL: &'static str;
    /// Elements, if it is an array.
    const COUNT: Option<usize> = None;
    /// Words that it takes, without gaps: all that it is made of is aligned to a word.
    const WORDS: usize = 1;
    /// The members of a struct, or of the elements of an array.
    const FIELDS: &'static [Field] = &[];

    /// Writes the value to the first words and returns those after it.
    fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32];
}

/// A member of a struct.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name, the same in Rust and GLSL.
    pub name: &'static str,
    /// [`Numbers::GLSL`].
    pub glsl: &'static str,
    /// [`Numbers::COUNT`].
    pub count: Option<usize>,
    /// [`Numbers::FIELDS`].
    pub fields: &'static [Self],
}

impl Field {
    /// A member of this name and type.
    #[must_use]
    pub const fn of<T: Numbers>(name: &'static str) -> Self {
        Self { name, glsl: T::GLSL, count: T::COUNT, fields: T::FIELDS }
    }
}

impl Numbers for u32 {
    const GLSL: &'static str = "uint";

    fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
        words[0] = *self;
        &mut words[1..]
    }
}

impl Numbers for i32 {
    const GLSL: &'static str = "int";

    fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
        self.cast_unsigned().put(words)
    }
}

/// Two words, the low one first.
impl Numbers for u64 {
    const GLSL: &'static str = "uint";
    const COUNT: Option<usize> = Some(2);
    const WORDS: usize = 2;

    fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
        [*self as u32, (self >> 32) as u32].put(words)
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    const GLSL: &'static str = T::GLSL;
    const COUNT: Option<usize> = Some(N);
    const WORDS: usize = N * T::WORDS;
    const FIELDS: &'static [Field] = T::FIELDS;

    fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
        self.iter().fold(words, |rest, value| value.put(rest))
    }
}

/// Makes a struct of public fields, and what [`Numbers`] says of it, from a table of rows `name: type,` or `name: type
/// = default,`. With defaults the struct has a constant `FREE`.
macro_rules! numbers {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$about:meta])* $field:ident: $kind:ty = $default:expr,)+ }) => {
        numbers! { $(#[$meta])* pub struct $name { $($(#[$about])* $field: $kind,)+ } }

        impl $name {
            /// As in the style `free`.
            pub const FREE: Self = Self { $($field: $default),+ };
        }
    };
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$about:meta])* $field:ident: $kind:ty,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct $name {
            $($(#[$about])* pub $field: $kind,)+
        }

        impl $crate::model::cells::numbers::Numbers for $name {
            const GLSL: &'static str = stringify!($name);
            const WORDS: usize = 0 $(+ <$kind as $crate::model::cells::numbers::Numbers>::WORDS)+;
            const FIELDS: &'static [$crate::model::cells::numbers::Field] =
                &[$($crate::model::cells::numbers::Field::of::<$kind>(stringify!($field)),)+];

            fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
                $(let words = $crate::model::cells::numbers::Numbers::put(&self.$field, words);)+
                words
            }
        }
    };
}

/// Makes an enum that crosses as the number of its variant.
macro_rules! choice {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$about:meta])* $variant:ident = $number:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name {
            $($(#[$about])* $variant = $number,)+
        }

        impl $crate::model::cells::numbers::Numbers for $name {
            const GLSL: &'static str = "uint";

            fn put<'a>(&self, words: &'a mut [u32]) -> &'a mut [u32] {
                $crate::model::cells::numbers::Numbers::put(&(*self as u32), words)
            }
        }
    };
}

pub(crate) use {choice, numbers};

#[cfg(test)]
mod tests {
    use super::Numbers;
    use crate::model::cells::rules::Rules;

    fn words_of(field: &super::Field) -> usize {
        let own: usize = field.fields.iter().map(words_of).sum();
        field.count.unwrap_or(1) * own.max(1)
    }

    #[test]
    fn a_struct_takes_the_words_of_its_fields_in_their_order() {
        let mut words = [u32::MAX; Rules::WORDS + 1];
        let rest = Rules::free(7 << 32 | 5, 360, 120, [0; 3]).put(&mut words);
        assert_eq!(rest, [u32::MAX], "it writes all its words and no more");
        assert_eq!(words[..3], [5, 7, 360], "seed and side come first");
        assert_eq!(Rules::FIELDS.iter().map(words_of).sum::<usize>(), Rules::WORDS, "fields leave no gaps");
    }
}
