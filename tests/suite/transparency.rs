//! Pictures with nothing behind their tiles: alpha, exactly, on the CPU and on Vulkan, and in what is written.

use std::io::{Cursor, Read};

use image::{Rgba, RgbaImage};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use smalti::archive::{self, Archive};
use smalti::cpu::CpuPainter;
use smalti::gpu::GpuPainter;
use smalti::model::{Backdrop, Canvas, Grout, Mosaic, NO_FLY, Painter, Population};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::cli_refusals::refused;
use crate::exactness::population;
use crate::reference::Reference;
use crate::scenarios::{Scenario, dressed_scenarios, scenarios, translucent_scenarios};
use crate::workshop::Workshop;

/// Those of a size that is drawn quickly.
fn quick(scenarios: impl IntoIterator<Item = Scenario>) -> impl Iterator<Item = Scenario> {
    let is_small = |&(width_px, height_px): &(u32, u32)| width_px.max(height_px) <= 256;
    scenarios.into_iter().filter(move |scenario| is_small(&size_px(scenario)))
}

fn size_px(Scenario { scene, .. }: &Scenario) -> (u32, u32) {
    (scene.target.width_px(), scene.target.height_px())
}

fn transparent(Scenario { scene, flies, .. }: &Scenario) -> Population {
    Population { background: Backdrop::Transparent, ..population(scene, flies) }
}

fn draw(population: &Population, canvas: &Canvas, supersampling: u32) -> Mosaic {
    CpuPainter.draw(population, canvas, supersampling).expect("the twin draws anything")
}

#[test]
fn where_no_tile_is_alpha_is_0_and_all_else_is_opaque_and_as_over_a_colour() {
    let mut clear = 0;
    let [dressed, _] = dressed_scenarios();
    for scenario in quick(scenarios().into_iter().chain([dressed])) {
        let reference = Reference::new(&scenario.scene, &scenario.flies);
        let (colors, top) = (reference.colors(), reference.layer(0));
        let (width_px, height_px) = size_px(&scenario);
        let drawn = draw(&transparent(&scenario), &Canvas::evaluation(width_px, height_px), 1);
        let alpha = drawn.alpha.expect("it has alpha");
        for (pixel, &fly) in top.iter().enumerate() {
            let expected = if fly == NO_FLY { ([0; 3], 0) } else { (colors[pixel], 255) };
            assert_eq!((drawn.pixels[pixel], alpha[pixel]), expected, "{} at {pixel}", scenario.name);
            clear += u32::from(fly == NO_FLY);
        }
        assert_eq!(draw(&population(&scenario.scene, &scenario.flies), &Canvas::evaluation(9, 9), 1).alpha, None);
    }
    assert!(clear > 1_000, "only {clear} pixels are clear");
}

#[test]
fn a_supersampled_pixel_has_the_mean_alpha_of_its_samples_and_the_mean_colour_of_those_that_are_covered() {
    let mut partial = 0;
    for scenario in quick(scenarios()).filter(|scenario| scenario.flies.len() <= 300) {
        let (width_px, height_px) = size_px(&scenario);
        let population = transparent(&scenario);
        for (long_side_px, supersampling) in [(60, 3), (25, 16)] {
            let canvas = Canvas::scaled(width_px, height_px, long_side_px);
            let samples = draw(&population, &canvas.supersampled(supersampling), 1);
            let covered = samples.alpha.as_ref().expect("it has alpha");
            let found = draw(&population, &canvas, supersampling);
            let alpha = found.alpha.expect("it has alpha");
            for (pixel, (color, &alpha)) in (0..).zip(found.pixels.iter().zip(&alpha)) {
                let (i, j) = (pixel % canvas.width_px * supersampling, pixel / canvas.width_px * supersampling);
                let places =
                    (j..j + supersampling).flat_map(|row| (i..i + supersampling).map(move |column| (row, column)));
                let places = places.map(|(row, column)| (row * samples.width_px + column) as usize);
                let seen: Vec<[u8; 3]> =
                    places.filter(|&place| covered[place] == 255).map(|place| samples.pixels[place]).collect();
                let rounded = |sum: usize, count: usize| ((2 * sum + count) / (2 * count).max(1)) as u8;
                let count = (supersampling * supersampling) as usize;
                assert_eq!(alpha, rounded(255 * seen.len(), count), "{} at {pixel}", scenario.name);
                let mean = [0, 1, 2].map(|c| rounded(seen.iter().map(|color| usize::from(color[c])).sum(), seen.len()));
                assert_eq!(*color, mean, "{} at {pixel}", scenario.name);
                partial += u32::from(!matches!(alpha, 0 | 255));
            }
        }
    }
    assert!(partial > 100, "only {partial} pixels are partly covered");
}

#[test]
fn transparent_pictures_are_drawn_alike_on_the_cpu_and_on_vulkan_at_any_size_and_supersampling() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let all = quick(scenarios().into_iter().chain(translucent_scenarios()));
        for scenario in all.filter(|scenario| scenario.flies.len() <= 300) {
            let (width_px, height_px) = size_px(&scenario);
            let mut vulkan = GpuPainter::create(&device).expect("the device works");
            let plain = transparent(&scenario);
            let grouted = Population { grout: Some(Grout { width: 20, color: [9; 3] }), ..plain.clone() };
            let own = width_px.max(height_px);
            for (population, long_side_px, supersampling) in [(&plain, own, 1), (&plain, 17, 2), (&grouted, 90, 3)] {
                let canvas = Canvas::scaled(width_px, height_px, long_side_px);
                let drawn = vulkan.draw(population, &canvas, supersampling).expect("the painter works");
                let same = draw(population, &canvas, supersampling) == drawn;
                assert!(same, "{} at {long_side_px} px with {supersampling}² samples", scenario.name);
            }
        }
    });
}

#[test]
fn translucent_tiles_over_nothing_are_over_any_colour_what_they_are_when_drawn_over_it() {
    let mut partial = 0;
    for scenario in quick(translucent_scenarios()).filter(|scenario| scenario.flies.len() <= 300) {
        let (width_px, height_px) = size_px(&scenario);
        let canvas = Canvas::evaluation(width_px, height_px);
        let Mosaic { pixels, alpha, .. } = draw(&transparent(&scenario), &canvas, 1);
        for background in [[0; 3], [255, 0, 130]] {
            let population = Population { background: background.into(), ..transparent(&scenario) };
            for ((color, &alpha), over) in
                pixels.iter().zip(alpha.as_ref().unwrap()).zip(draw(&population, &canvas, 1).pixels)
            {
                partial += u32::from(!matches!(alpha, 0 | 255));
                let share = f64::from(alpha) / 255.0;
                let composed =
                    [0, 1, 2].map(|c| f64::from(color[c]) * share + f64::from(background[c]) * (1.0 - share));
                let off = composed.iter().zip(over).map(|(composed, over)| (composed - f64::from(over)).abs());
                // Colour, opacity and result are rounded, each by half at most.
                assert!(off.fold(0.0, f64::max) <= 1.5, "{composed:?} and not {over:?} in {}", scenario.name);
            }
        }
    }
    assert!(partial > 1_000, "only {partial} pixels are translucent");
}

/// A folder with `flies.npz`, transparent with few tiles, and the population in it.
fn workshop() -> (Workshop, Population) {
    let workshop = Workshop::new();
    let line = "evolve photo.png --scheme paper -n 9 --births 20 -o flies.npz --background white";
    assert_eq!(workshop.run(line).code, Some(0));
    let Archive { mut population, fitness, meta } = archive::read(&workshop.path("flies.npz")).unwrap();
    population.background = Backdrop::Transparent;
    workshop.write("flies.npz", &archive::encode(&population, &fitness, &meta).unwrap());
    (workshop, population)
}

fn render(workshop: &Workshop, rest: &str) {
    let ran = workshop.run(&format!("render flies.npz {rest}"));
    assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
}

fn rgba(workshop: &Workshop, name: &str) -> RgbaImage {
    let picture = image::open(workshop.path(name)).unwrap();
    assert!(picture.color().has_alpha(), "{name} has no alpha");
    picture.to_rgba8()
}

/// A drawn mosaic as a picture.
fn picture(Mosaic { width_px, height_px, pixels, alpha }: Mosaic) -> RgbaImage {
    let alpha = alpha.expect("it has alpha");
    RgbaImage::from_fn(width_px, height_px, |i, j| {
        let ([r, g, b], place) = (pixels[(j * width_px + i) as usize], (j * width_px + i) as usize);
        Rgba([r, g, b, alpha[place]])
    })
}

#[test]
fn pictures_with_alpha_are_written_as_drawn_and_those_without_show_black() {
    let (workshop, population) = workshop();
    render(&workshop, "-o a.png -o a.webp -o a.npz -o a.json --output-size 80 --supersample 3");
    let expected = picture(draw(&population, &Canvas::scaled(40, 30, 80), 3));
    assert!(expected.pixels().any(|pixel| pixel.0[3] == 0) && expected.pixels().any(|pixel| pixel.0[3] == 255));
    for name in ["a.png", "a.webp"] {
        assert!(rgba(&workshop, name) == expected, "{name}");
    }
    // At the evolved size a pixel is there or not.
    render(&workshop, "-o b.jpg");
    render(&workshop, "-o c.jpg --background black");
    assert_eq!(workshop.pixels("b.jpg"), workshop.pixels("c.jpg"));
    assert_eq!(archive::read(&workshop.path("a.npz")).unwrap().population, population);
    let table: serde_json::Value = serde_json::from_slice(&workshop.read("a.json")).unwrap();
    assert_eq!(table["background"], "transparent");
}

#[test]
fn a_colour_that_is_asked_for_shows_instead_of_nothing_and_is_another_picture() {
    let (workshop, population) = workshop();
    render(&workshop, "-o a.png");
    refused(&workshop, "render flies.npz -o a.png --background black", 2, "made with other options");
    render(&workshop, "-o b.png -o b.npz --background 336699");
    let population = Population { background: [0x33, 0x66, 0x99].into(), ..population };
    assert!(!image::open(workshop.path("b.png")).unwrap().color().has_alpha());
    let drawn = draw(&population, &Canvas::evaluation(40, 30), 1);
    assert_eq!(workshop.pixels("b.png").as_raw(), drawn.pixels.as_flattened());
    assert_eq!(archive::read(&workshop.path("b.npz")).unwrap().population, population);
}

#[test]
fn an_svg_without_a_background_is_clear_where_no_tile_is() {
    let (workshop, population) = workshop();
    render(&workshop, "-o a.svg --output-size 160");
    let tree = Tree::from_data(&workshop.read("a.svg"), &Options::default()).unwrap();
    let mut pixmap = Pixmap::new(160, 120).unwrap();
    resvg::render(&tree, Transform::identity(), &mut pixmap.as_mut());
    let expected = draw(&population, &Canvas::scaled(40, 30, 160), 8).alpha.unwrap();
    let found = pixmap.pixels().iter().map(|pixel| pixel.alpha());
    // Edges are antialiased in other ways; where several meet, by more.
    let off: Vec<u8> = expected.iter().zip(found).map(|(&expected, found)| expected.abs_diff(found)).collect();
    assert!(off.iter().filter(|&&off| off > 24).count() * 200 < off.len(), "{off:?}");
    assert!(expected.contains(&0) && expected.contains(&255));
}

#[test]
fn openraster_layers_without_a_background_are_together_the_merged_picture() {
    let (workshop, _) = workshop();
    render(&workshop, "-o a.ora -o a.png");
    let mut zip = zip::ZipArchive::new(Cursor::new(workshop.read("a.ora"))).unwrap();
    let mut read = |name: &str| {
        let mut bytes = Vec::new();
        zip.by_name(name).unwrap_or_else(|error| panic!("{name}: {error}")).read_to_end(&mut bytes).unwrap();
        bytes
    };
    let stack = String::from_utf8(read("stack.xml")).unwrap();
    assert!(!stack.contains("Background"), "{stack}");
    let mut decoded = |name: &str| image::load_from_memory(&read(name)).unwrap().to_rgba8();
    let merged = decoded("mergedimage.png");
    assert!(merged == rgba(&workshop, "a.png"));
    let mut composed = RgbaImage::new(40, 30);
    for number in 0..stack.matches("<layer ").count() {
        let layer = decoded(&format!("data/layer{number}.png"));
        // At evaluation size a pixel is there or not.
        let over = composed.pixels_mut().zip(layer.pixels()).filter(|(_, above)| above.0[3] == 255);
        over.for_each(|(below, above)| *below = *above);
    }
    assert!(composed == merged);
    assert!(decoded("Thumbnails/thumbnail.png").pixels().any(|pixel| pixel.0[3] == 0));
}

#[test]
fn a_transparent_population_comes_back_and_files_of_others_do_not_speak_of_it() {
    let (workshop, population) = workshop();
    let Archive { population: read, fitness, meta } = archive::read(&workshop.path("flies.npz")).unwrap();
    assert_eq!(read, population);
    let bytes = archive::encode(&read, &fitness, &meta).unwrap();
    assert!(bytes == workshop.read("flies.npz"), "saving what was loaded changes nothing");
    let header = |bytes: &[u8]| {
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes.to_vec())).unwrap();
        let mut text = String::new();
        zip.by_name("meta.json").unwrap().read_to_string(&mut text).unwrap();
        text
    };
    assert!(header(&bytes).contains("\"transparent\": true"));
    let opaque = Population { background: [0; 3].into(), ..population };
    assert!(!header(&archive::encode(&opaque, &fitness, &meta).unwrap()).contains("transparent"));
}
