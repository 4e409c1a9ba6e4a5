//! Masks in SVG that ask for more work or memory than a mask is worth, and those that do not.

use crate::cli_refusals::refused;
use crate::hostile_files::assert_quiet;
use crate::workshop::Workshop;

fn svg(body: &str) -> String {
    format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10">{body}</svg>"#)
}

/// `first`, and then pairs of elements that each wear the one before as `property`.
fn doubling(element: &str, property: &str, levels: usize) -> String {
    let mut body = format!(r##"<{element} id="m0"><rect width="10" height="10" fill="#fff"/></{element}>"##);
    for level in 1..=levels {
        let wearer = format!(r##"<rect width="9" height="9" fill="#fff" {property}="url(#m{})"/>"##, level - 1);
        body += &format!(r#"<{element} id="m{level}">{wearer}{wearer}</{element}>"#);
    }
    body + &format!(r##"<g {property}="url(#m{levels})"><rect width="10" height="10" fill="#fff"/></g>"##)
}

#[test]
fn an_svg_that_asks_for_endless_work_is_refused_at_once() {
    let workshop = Workshop::new();
    let vertices = "M0 0".to_owned() + &"L 1 1 L 2 3".repeat(400);
    let marker = format!(r#"<marker id="m" markerWidth="3" markerHeight="3"><path d="{vertices}"/></marker>"#);
    let entities = format!(
        "<!DOCTYPE svg [<!ENTITY a \"{}\">]>{}",
        "L1 1".repeat(1_000),
        svg(&format!(r#"<path d="M0 0{}"/>"#, "&a;".repeat(200)))
    );
    let deep = "<g>".repeat(5_000) + "<rect width=\"9\" height=\"9\"/>" + &"</g>".repeat(5_000);
    let cases = [
        ("absurd coordinates", svg(r##"<path d="M-1e9 -1e9 L1e9 1e9 L3e9 0Z" fill="#fff"/>"##), "coordinates far"),
        ("an absurd arc", svg(r#"<path d="M0 0 L3e38 0 A 1e38 1e38 0 1 1 5 5"/>"#), "coordinates far"),
        ("an absurd circle", svg(r#"<circle r="1e30"/><rect width="9" height="9"/>"#), "coordinates far"),
        ("an absurd scale", svg(r#"<rect transform="scale(1e12)" width="9" height="9"/>"#), "coordinates far"),
        ("an absurd stroke", svg(r##"<path d="M0 0H9" stroke="#fff" stroke-width="1e30"/>"##), "coordinates far"),
        ("markers", svg(&format!(r#"{marker}<path d="{vertices}" marker-mid="url(#m)"/>"#)), "too many elements"),
        (
            "markers of a style",
            svg(&format!(r#"<style>path.a{{marker:url(#m)}}</style>{marker}<path class="a" d="{vertices}"/>"#)),
            "too many elements",
        ),
        ("masks", svg(&doubling("mask", "mask", 11)), "too many"),
        ("masks in layers", svg(&doubling("mask", "mask", 9)), "layers of masks"),
        ("clips", svg(&doubling("clipPath", "clip-path", 11)), "too many"),
        ("clips in layers", svg(&doubling("clipPath", "clip-path", 9)), "layers of masks"),
        ("entities", entities, "declares entities"),
        ("a deep nest", svg(&deep), "nests too deep"),
        ("many elements", svg(&r#"<rect width="9" height="9"/>"#.repeat(30_000)), "too many elements"),
        ("many nodes", svg(&"<!---->".repeat(300_000)), "too many elements"),
        (
            "dashes",
            svg(r##"<path d="M0 0H9999V9999H1V9H999" stroke="#fff" stroke-width="1" stroke-dasharray="0.01"/>"##),
            "too many points or dashes",
        ),
        ("a heavy file", svg(&" ".repeat(9 << 20)), "more than 8 MiB"),
    ];
    for (what, text, words) in cases {
        let name = format!("{}.svg", what.replace(' ', "-"));
        workshop.write(&name, text.as_bytes());
        let line = format!("evolve photo.png -o o.png -n 8 --size 16 --mask {name}");
        assert_quiet(&refused(&workshop, &line, 2, words));
    }
}

#[test]
fn an_svg_as_programs_write_it_is_still_drawn() {
    let workshop = Workshop::new();
    let doctype = "<?xml version=\"1.0\"?><!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.1//EN\" \
                   \"http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd\">";
    let gradient =
        r##"<linearGradient id="g"><stop stop-color="#fff"/><stop offset="1" stop-color="#888"/></linearGradient>"##;
    let marker = r#"<marker id="m" markerWidth="3" markerHeight="3"><path d="M0 0L3 1.5 0 3z"/></marker>"#;
    for body in [
        format!(r#"{gradient}<style>.a,.b{{fill:url(#g)}}</style><circle class="a" cx="5" cy="5" r="4"/>"#),
        format!(r##"{marker}<path d="M1 1L9 9" stroke="#fff" marker-end="url(#m)"/>"##),
        doubling("mask", "mask", 3),
        doubling("clipPath", "clip-path", 0),
        r##"<g id="a"><circle r="2"/></g><use href="#a" x="5" y="5"/><a href="#a"><rect width="1" height="1"/></a>"##
            .to_owned(),
        r##"<path d="M1 1H9" stroke="#fff" stroke-dasharray="1 0.5"/>"##.to_owned(),
    ] {
        workshop.write("mask.svg", (doctype.to_owned() + &svg(&body)).as_bytes());
        let ran = workshop.run("evolve photo.png -o o.png -n 8 --evals 500 --size 16 --force --mask mask.svg");
        assert_eq!(ran.code, Some(0), "{body}: {}", ran.stderr);
    }
}
