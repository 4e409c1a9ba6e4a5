//! Text inside XML, for files whose metadata is XML.

/// `text` as the content of an element.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for char in text.chars() {
        match char {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            // XML parsers turn a bare carriage return into a line feed.
            '\r' => escaped.push_str("&#13;"),
            char => escaped.push(char),
        }
    }
    escaped
}

/// The text that [`escape`] escaped.
pub(crate) fn unescape(escaped: &str) -> String {
    escaped.replace("&#13;", "\r").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
}

/// The contents of all elements `<name>..</name>` of `document`. They must have no attributes and no element of the
/// same name inside.
pub(crate) fn contents<'a>(document: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let (open, close) = (format!("<{name}>"), format!("</{name}>"));
    let mut rest = document;
    std::iter::from_fn(move || {
        let (content, after) = rest.split_once(&open)?.1.split_once(&close)?;
        rest = after;
        Some(content)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_comes_back_from_inside_an_element() {
        for text in ["", "plain", "a < b && c > d", "&lt; &amp;lt; &#13;", "]]>\r\n</li>", "Grüße, 馬賽克"] {
            let document = format!("<list><li>{}</li><li>next</li></list>", escape(text));
            assert_eq!(contents(&document, "li").map(unescape).collect::<Vec<_>>(), [text, "next"]);
        }
    }

    #[test]
    fn an_element_that_does_not_end_is_none() {
        assert_eq!(contents("<li>a</li><li>b", "li").collect::<Vec<_>>(), ["a"]);
    }
}
