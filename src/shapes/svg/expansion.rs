//! How many elements an SVG comes to once everything that repeats others is written out, counted without writing it
//! out: `use`, markers, paints, clips and masks.
//!
//! Counts are upper bounds. A style sheet is not resolved: a rule counts for every element whose name, class or id its
//! selector mentions.

use std::collections::{HashMap, HashSet};

use resvg::usvg::roxmltree::{Document, Node, NodeId};

use super::extent::TOO_FAR;

/// Most elements, with what they repeat.
const ELEMENTS_MAX: u64 = 20_000;
/// Most numbers in the paths of these elements.
const NUMBERS_MAX: u64 = 500_000;
/// Deepest nesting, with what is repeated.
const DEPTH_MAX: usize = 128;
/// Largest coordinate of a path. Arcs are cut into the more pieces the larger they are.
const COORDINATE_MAX: f64 = 1e7;
/// Most bytes of style sheets.
const STYLE_BYTES_MAX: usize = 1 << 16;
/// Most pairs of a rule and an element.
const MATCHES_MAX: usize = 2_000_000;
/// Numbers of a shape that is no path.
const NUMBERS_OF_SHAPE: u64 = 8;

pub(super) const TOO_MANY_ELEMENTS: &str =
    "the SVG has too many elements, with all that it repeats; simplify it, or export it as PNG";
const TOO_DEEP: &str = "the SVG nests too deep; ungroup its elements, or export it as PNG";

/// Refuses a document that is too large when it is written out.
///
/// # Errors
/// A sentence for the user.
pub(super) fn check(document: &Document<'_>) -> Result<(), String> {
    if document.descendants().any(|node| node.ancestors().nth(DEPTH_MAX).is_some()) {
        return Err(TOO_DEEP.to_owned());
    }
    let mut expansion = Expansion::new(document)?;
    expansion.cost(document.root_element(), 0).map(|_| ())
}

/// What an element comes to, with everything in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cost {
    elements: u64,
    numbers: u64,
}

impl Cost {
    fn plus(self, other: Self, times: u64) -> Self {
        Self {
            elements: self.elements.saturating_add(other.elements.saturating_mul(times)),
            numbers: self.numbers.saturating_add(other.numbers.saturating_mul(times)),
        }
    }

    fn checked(self) -> Result<Self, String> {
        if self.elements > ELEMENTS_MAX || self.numbers > NUMBERS_MAX {
            return Err(TOO_MANY_ELEMENTS.to_owned());
        }
        Ok(self)
    }
}

/// How often what is referred to is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Repeats {
    Once,
    /// For every element inside, which inherits it.
    ByElement,
    /// At every point of every path inside.
    ByNumber,
}

/// A rule of a style sheet that refers to elements.
struct Rule<'a> {
    selector: &'a str,
    references: Vec<(&'a str, Repeats)>,
}

struct Expansion<'a> {
    by_id: HashMap<&'a str, Node<'a, 'a>>,
    rules: Vec<Rule<'a>>,
    known: HashMap<NodeId, Cost>,
    /// Elements whose cost is being counted.
    open: HashSet<NodeId>,
    /// The markers among them, outermost first.
    open_markers: Vec<NodeId>,
    /// Whether a marker was left out of what is being counted, which therefore is right only inside of that marker.
    is_partial: bool,
}

impl<'a> Expansion<'a> {
    fn new(document: &'a Document<'_>) -> Result<Self, String> {
        let elements = || document.descendants().filter(Node::is_element);
        let sheets: Vec<&str> =
            elements().filter(|node| node.tag_name().name() == "style").filter_map(|node| node.text()).collect();
        let style_bytes: usize = sheets.iter().map(|sheet| sheet.len()).sum();
        let rule_count: usize = sheets.iter().map(|sheet| sheet.matches(['{', ',']).count()).sum();
        if style_bytes > STYLE_BYTES_MAX || rule_count * elements().count() > MATCHES_MAX {
            return Err("the SVG has too large a style sheet; simplify it, or export it as PNG".to_owned());
        }
        let mut by_id = HashMap::new();
        for node in elements() {
            if let Some(id) = node.attribute("id") {
                by_id.entry(id).or_insert(node);
            }
        }
        let rules = sheets.into_iter().flat_map(rules).collect();
        Ok(Self {
            by_id,
            rules,
            known: HashMap::new(),
            open: HashSet::new(),
            open_markers: Vec::new(),
            is_partial: false,
        })
    }

    /// What an element comes to that lies so deep.
    fn cost(&mut self, node: Node<'a, 'a>, depth: usize) -> Result<Cost, String> {
        if let Some(&known) = self.known.get(&node.id()) {
            return Ok(known);
        }
        if depth > DEPTH_MAX {
            return Err(TOO_DEEP.to_owned());
        }
        if !self.open.insert(node.id()) {
            return Err("the SVG has an element that is drawn inside itself; correct it or export it again".to_owned());
        }
        let is_marker = node.tag_name().name() == "marker";
        let was_partial = self.is_partial;
        self.open_markers.extend(is_marker.then(|| node.id()));
        let mut cost = Cost { elements: 1, numbers: NUMBERS_OF_SHAPE };
        for list in ["d", "points"].into_iter().filter_map(|name| node.attribute(name)) {
            cost.numbers = cost.numbers.saturating_add(numbers(list)?);
        }
        for child in node.children().filter(Node::is_element) {
            cost = cost.plus(self.cost(child, depth + 1)?, 1).checked()?;
        }
        let mut references = self.references(node);
        // What is drawn once may inherit the others.
        references.sort_by_key(|(_, repeats)| *repeats != Repeats::Once);
        for (id, repeats) in references {
            let Some(&target) = self.by_id.get(id) else { continue };
            // A style may give the paths in a marker that marker, where it is not drawn again.
            if self.open_markers.last() == Some(&target.id()) {
                self.is_partial = true;
                continue;
            }
            let times = match repeats {
                Repeats::Once => 1,
                Repeats::ByElement => cost.elements,
                Repeats::ByNumber => cost.numbers,
            };
            cost = cost.plus(self.cost(target, depth + 1)?, times).checked()?;
        }
        self.open.remove(&node.id());
        if is_marker {
            self.open_markers.pop();
            self.is_partial = was_partial;
        }
        if !self.is_partial {
            self.known.insert(node.id(), cost);
        }
        cost.checked()
    }

    /// The ids of the elements that an element refers to.
    fn references(&self, node: Node<'a, 'a>) -> Vec<(&'a str, Repeats)> {
        let mut found = Vec::new();
        for attribute in node.attributes() {
            match attribute.name() {
                "href" if is_template(node.tag_name().name()) => {
                    found.extend(attribute.value().strip_prefix('#').map(|id| (id, Repeats::Once)));
                }
                "style" => found.extend(declared(attribute.value())),
                name => found.extend(urls(attribute.value()).map(|id| (id, repeats(name)))),
            }
        }
        let classes = node.attribute("class").unwrap_or_default().split_whitespace();
        let names: Vec<&str> = classes.chain(node.attribute("id")).chain([node.tag_name().name()]).collect();
        let its_rules = self.rules.iter().filter(|rule| {
            rule.selector.contains(['*', '[', ':']) || names.iter().any(|name| rule.selector.contains(name))
        });
        found.extend(its_rules.flat_map(|rule| rule.references.iter().copied()));
        found
    }
}

/// Whether `href` of an element of this name means that another one is drawn or taken over; elsewhere it is a link.
fn is_template(name: &str) -> bool {
    matches!(name, "use" | "pattern" | "linearGradient" | "radialGradient" | "filter" | "feImage" | "clipPath" | "mask")
}

fn repeats(property: &str) -> Repeats {
    if property.starts_with("marker") {
        Repeats::ByNumber
    } else if matches!(property, "fill" | "stroke") {
        Repeats::ByElement
    } else {
        Repeats::Once
    }
}

/// The ids in `url(#id)`.
fn urls(text: &str) -> impl Iterator<Item = &str> {
    text.split("url(").skip(1).filter_map(|rest| {
        let address = rest.split(')').next()?.trim().trim_matches(['\'', '"']);
        address.trim().strip_prefix('#')
    })
}

/// The ids that declarations such as `fill: url(#a); opacity: 1` refer to.
fn declared(declarations: &str) -> impl Iterator<Item = (&str, Repeats)> {
    declarations.split(';').filter_map(|declaration| declaration.split_once(':')).flat_map(|(property, value)| {
        let repeats = repeats(property.trim());
        urls(value).map(move |id| (id, repeats))
    })
}

/// The rules of a style sheet that refer to elements.
fn rules(sheet: &str) -> impl Iterator<Item = Rule<'_>> {
    sheet.split('}').filter_map(|rule| {
        let (selector, declarations) = rule.rsplit_once('{')?;
        let references: Vec<_> = declared(declarations).collect();
        (!references.is_empty()).then_some(Rule { selector, references })
    })
}

/// How many numbers and commands a list of coordinates or a path has.
///
/// # Errors
/// If one of them is absurdly large.
fn numbers(list: &str) -> Result<u64, String> {
    let mut count = 0;
    let mut rest = list;
    while let Some(first) = rest.find(|char: char| char.is_ascii_alphanumeric() || char == '.') {
        rest = &rest[first..];
        count += 1;
        let length = number_length(rest.as_bytes());
        if length == 0 {
            // A command, which some numbers may follow.
            rest = &rest[1..];
            continue;
        }
        let value = rest[..length].parse::<f64>();
        if value.is_ok_and(|value| value > COORDINATE_MAX) {
            return Err(TOO_FAR.to_owned());
        }
        rest = &rest[length..];
    }
    Ok(count)
}

/// How many bytes the unsigned number has that a text begins with; 0 if it begins with none.
fn number_length(text: &[u8]) -> usize {
    let digits = |from: usize| text[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut length = digits(0);
    if text.get(length) == Some(&b'.') {
        length += 1 + digits(length + 1);
    }
    if length > 0 && matches!(text.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(text.get(length + 1), Some(b'+' | b'-')));
        let exponent = if length + 1 + sign <= text.len() { digits(length + 1 + sign) } else { 0 };
        length += if exponent > 0 { 1 + sign + exponent } else { 0 };
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(body: &str) -> Result<Cost, String> {
        let text = format!(r#"<svg xmlns="http://www.w3.org/2000/svg">{body}</svg>"#);
        let document = Document::parse(&text).expect("it is XML");
        Expansion::new(&document)?.cost(document.root_element(), 0)
    }

    fn elements(body: &str) -> u64 {
        cost(body).expect("it is small").elements
    }

    #[test]
    fn what_is_repeated_counts_as_often_as_it_is_drawn() {
        assert_eq!(elements("<g><rect/></g>"), 3);
        assert_eq!(elements(r##"<g id="a"><rect/></g><use href="#a"/><use href="#a"/>"##), 1 + 2 + 3 + 3);
        let gradient = r#"<linearGradient id="g"><stop/></linearGradient>"#;
        assert_eq!(elements(&format!(r#"{gradient}<g fill="url(#g)"><rect/><rect/></g>"#)), 1 + 2 + 3 + 3 * 2);
        assert_eq!(elements(&format!(r#"{gradient}<g style="stroke:url('#g')"><rect/></g>"#)), 1 + 2 + 2 + 2 * 2);
        assert_eq!(elements(&format!(r#"{gradient}<style>.x{{fill:url(#g)}}</style><g class="y x"/>"#)), 1 + 2 + 1 + 3);
        assert_eq!(elements(&format!(r#"{gradient}<style>.x{{fill:url(#g)}}</style><g class="y"/>"#)), 1 + 2 + 1 + 1);
        let marker = r#"<marker id="m"><path d="M0 0"/></marker>"#;
        let marked = elements(&format!(r#"{marker}<path d="M0 0 1 1" marker-mid="url(#m)"/>"#));
        assert_eq!(marked, 1 + 2 + 1 + (NUMBERS_OF_SHAPE + 5) * 2);
        let itself = r#"<style>path{marker:url(#m)}</style>"#;
        let marked = elements(&format!(r#"{itself}{marker}<path d="M0 0"/>"#));
        assert_eq!(marked, 1 + 1 + 2 + 1 + (NUMBERS_OF_SHAPE + 3) * 2);
        assert_eq!(elements(r##"<g id="top"><a href="#top"/></g>"##), 3, "a link draws nothing");
    }

    #[test]
    fn chains_that_double_loops_and_deep_nests_are_refused() {
        for reference in ["mask=\"url(#l", "clip-path=\"url(#l", "filter=\"url(#l"] {
            let chain: String = (1..40)
                .map(|n| format!(r#"<g id="l{n}"><g {reference}{0})"/><g {reference}{0})"/></g>"#, n - 1))
                .collect();
            assert_eq!(cost(&format!(r#"<g id="l0"/>{chain}"#)), Err(TOO_MANY_ELEMENTS.to_owned()));
        }
        let long: String = (1..200).map(|n| format!(r##"<use id="l{n}" href="#l{0}"/>"##, n + 1)).collect();
        assert_eq!(cost(&long), Err(TOO_DEEP.to_owned()));
        assert!(cost(r##"<g id="a"><use href="#a"/></g>"##).is_err_and(|reason| reason.contains("inside itself")));
    }

    #[test]
    fn the_numbers_of_a_path_are_counted_as_they_are_written() {
        for (path, count) in [("M0 0L1 1z", 7), ("M.5.5-1-1e-3,2", 6), ("", 0), ("a1 1 0 011.5.5", 6), ("e-+..", 3)] {
            assert_eq!(numbers(path), Ok(count), "{path}");
        }
        for path in ["M0 1e8", "M-1e38 0", "M99999999 0", "M1e400 0"] {
            assert_eq!(numbers(path), Err(TOO_FAR.to_owned()), "{path}");
        }
    }
}
