//! `smalti score` at work: its figures against those of scikit-image, and what it refuses.

use image::{Rgb, RgbImage, imageops};
use serde_json::{Value, json};

use crate::workshop::{Ran, Workshop};

/// The fields of [`GOLDEN`], in its order.
const FIELDS: [&str; 11] =
    ["MAE_R", "MAE_G", "MAE_B", "RMSE", "PSNR", "SSIM", "GMSM", "GMSD", "EDGE_P", "EDGE_R", "EDGE"];

/// For each picture of [`paint_cases`] its SAE, and the other figures as numpy 2.4, scipy 1.17 and scikit-image 0.26
/// compute them: `structural_similarity(channel_axis=2, data_range=255)`; `uniform_filter(luma, 2, mode="nearest")[::2,
/// ::2]` and `prewitt(.., mode="nearest") / 3`; `canny(luma / 255, 1, 0.1, 0.2)` and `distance_transform_edt(..) <= 2`.
const GOLDEN: [(&str, u64, [f64; 11]); 6] = [
    (
        "quantised.png",
        12_566_382,
        [
            14.362800598144531,
            15.968761444091797,
            17.60538101196289,
            18.535025012158325,
            22.770940080153522,
            0.7044492066950564,
            0.8788264532222778,
            0.15841623818860742,
            0.5754612230953194,
            0.8246753246753247,
            0.6778891269566816,
        ],
    ),
    (
        "shifted.png",
        7_228_043,
        [
            9.06216049194336,
            8.820831298828125,
            9.689804077148438,
            20.150288712142526,
            22.045178147332972,
            0.7055987677482009,
            0.9281024359288206,
            0.14762855878103004,
            0.7897558821674131,
            0.791199092169966,
            0.7904768284354728,
        ],
    ),
    (
        "blurred.png",
        2_226_398,
        [
            2.81280517578125,
            2.857666015625,
            2.8225631713867188,
            6.128437556768204,
            32.38380830090753,
            0.9426398727754087,
            0.9913188647058695,
            0.04150066720140191,
            0.9898469104465772,
            0.8379145126717942,
            0.907566032520219,
        ],
    ),
    (
        "tiled.png",
        9_330_404,
        [
            12.021499633789062,
            11.20163345336914,
            12.36953353881836,
            24.843066755132455,
            20.226699481791734,
            0.6355143029996125,
            0.8779618660126014,
            0.19532287103466023,
            0.538786828422877,
            0.5647459336779725,
            0.5514610547525619,
        ],
    ),
    (
        "swapped.png",
        30_983_194,
        [
            59.09575271606445,
            0.0,
            59.09575271606445,
            69.72793782563433,
            11.262667182306528,
            0.7999099434024313,
            0.9905499385061457,
            0.039197417215688826,
            0.9531627847779051,
            0.9451519354431975,
            0.9491404573002902,
        ],
    ),
    (
        "odd.png",
        408_707,
        [
            7.433302443544847,
            5.708871872408916,
            6.791835341169585,
            12.981991410925774,
            25.86397725948595,
            0.7832762390863811,
            0.9281193275208623,
            0.137337309670613,
            0.19030732860520094,
            0.5503355704697986,
            0.28281616520817043,
        ],
    ),
];

/// Writes `ref.png` and the pictures of [`GOLDEN`], each made from the parrots by a rule in integers.
fn paint_cases(workshop: &Workshop) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/photos/parrots.png");
    let parrots = image::open(path).unwrap().to_rgb8();
    let (width, height) = parrots.dimensions();
    let at = |x: u32, y: u32| parrots.get_pixel(x, y).0;
    // Beyond the border the outermost pixel repeats.
    let mean = |x: u32, y: u32, channel: usize| {
        let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
        let sum: u32 = rows.iter().flat_map(|&y| columns.map(|x| u32::from(at(x, y)[channel]))).sum();
        (sum / 9) as u8
    };
    let paint = |name: &str, rule: &dyn Fn(u32, u32) -> [u8; 3]| {
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb(rule(x, y)));
        picture.save(workshop.path(name)).unwrap();
        picture
    };
    paint("ref.png", &at);
    paint("quantised.png", &|x, y| at(x, y).map(|channel| channel / 64 * 64 + 32));
    paint("shifted.png", &|x, y| at(x.saturating_sub(3), y));
    paint("blurred.png", &|x, y| [0, 1, 2].map(|channel| mean(x, y, channel)));
    let tiled = paint("tiled.png", &|x, y| at(x / 8 * 8, y / 8 * 8));
    paint("swapped.png", &|x, y| [2, 1, 0].map(|channel| at(x, y)[channel]));
    // Odd sides: neither halves nor bands of rows end where the picture does.
    for (name, picture) in [("odd_ref.png", &parrots), ("odd.png", &tiled)] {
        imageops::crop_imm(picture, 150, 60, 203, 101).to_image().save(workshop.path(name)).unwrap();
    }
}

/// Runs `score` with `--json`, which must end with `code`; the array and the messages.
fn scores(workshop: &Workshop, line: &str, code: i32) -> (Vec<Value>, String) {
    let ran = workshop.run(&format!("score {line} --json"));
    assert_eq!(ran.code, Some(code), "{line}: {}", ran.stderr);
    (ran.row().as_array().expect("an array").clone(), ran.stderr)
}

fn table(ran: &Ran) -> Vec<Vec<&str>> {
    let text = std::str::from_utf8(&ran.stdout).unwrap();
    text.lines().map(|line| line.split_whitespace().collect()).collect()
}

#[test]
fn the_figures_are_those_of_scikit_image() {
    let workshop = Workshop::new();
    paint_cases(&workshop);
    let line = "ref.png quantised.png shifted.png blurred.png tiled.png swapped.png";
    let mut rows = scores(&workshop, line, 0).0;
    rows.extend(scores(&workshop, "odd_ref.png odd.png", 0).0);
    assert_eq!(rows.len(), GOLDEN.len());
    for (row, (file, sae, figures)) in rows.iter().zip(GOLDEN) {
        assert_eq!([&row["file"], &row["SAE"]], [&json!(file), &json!(sae)]);
        for (field, expected) in FIELDS.iter().zip(figures) {
            let value = row[field].as_f64().unwrap_or_else(|| panic!("{file}: {field} is {}", row[field]));
            assert!((value - expected).abs() < 1e-9, "{file}: {field} is {value}, not {expected}");
        }
        let pixel_count = row["width"].as_f64().unwrap() * row["height"].as_f64().unwrap();
        assert_eq!(row["MAE"], json!(sae as f64 / (pixel_count * 3.0)));
    }
}

#[test]
fn a_picture_is_perfectly_like_itself_also_in_another_format() {
    let workshop = Workshop::new();
    workshop.pixels("photo.png").save(workshop.path("copy.bmp")).unwrap();
    let row = scores(&workshop, "photo.png copy.bmp", 0).0.remove(0);
    assert_eq!(
        row,
        json!({
            "file": "copy.bmp", "width": 40, "height": 30, "SAE": 0, "MAE": 0.0, "MAE_R": 0.0, "MAE_G": 0.0, "MAE_B": 0.0,
            "RMSE": 0.0, "PSNR": null, "SSIM": 1.0, "GMSM": 1.0, "GMSD": 0.0, "EDGE": 1.0, "EDGE_P": 1.0, "EDGE_R": 1.0
        })
    );
    let ran = workshop.run("score photo.png copy.bmp photo.png");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let table = table(&ran);
    assert_eq!(table[0], ["SAE", "MAE", "RMSE", "PSNR", "SSIM", "GMSM", "GMSD", "EDGE", "file"]);
    for (line, file) in table[1..].iter().zip(["copy.bmp", "photo.png"]) {
        assert_eq!(*line, ["0", "0.0000", "0.0000", "inf", "1.0000", "1.0000", "0.0000", "1.0000", file]);
    }
    assert_eq!(ran.stderr, "");
}

#[test]
fn black_pictures_have_no_edges_to_lose_or_to_find() {
    let workshop = Workshop::new();
    RgbImage::new(40, 30).save(workshop.path("black.png")).unwrap();
    RgbImage::from_fn(40, 30, |x, _| Rgb([255 * u8::from(x > 20); 3])).save(workshop.path("step.png")).unwrap();
    let edges = |line: &str| {
        let row = scores(&workshop, line, 0).0.remove(0);
        ["EDGE", "EDGE_P", "EDGE_R"].map(|field| row[field].as_f64().unwrap())
    };
    assert_eq!(edges("black.png black.png"), [1.0; 3]);
    assert_eq!(edges("black.png step.png"), [0.0; 3]);
    assert_eq!(edges("step.png black.png"), [0.0; 3]);
    assert_eq!(edges("step.png step.png"), [1.0; 3]);
}

#[test]
fn the_figures_in_the_row_of_a_mosaic_are_those_of_its_score() {
    let workshop = Workshop::new();
    let evolved = workshop.evolve_to_row("-o a.png --save-target t.png");
    let row = scores(&workshop, "t.png a.png", 0).0.remove(0);
    assert_eq!([&row["SAE"], &row["PSNR"]], [&evolved["sae"], &evolved["psnr"]]);
}

#[test]
fn transparent_pixels_show_the_background() {
    let workshop = Workshop::new();
    image::RgbaImage::new(8, 8).save(workshop.path("glass.png")).unwrap();
    RgbImage::from_pixel(8, 8, Rgb([255, 128, 0])).save(workshop.path("orange.png")).unwrap();
    for (rest, sae) in [("", 64 * (255 + 128)), ("--background ff8000", 0), ("--background white", 64 * (127 + 255))] {
        let row = scores(&workshop, &format!("orange.png glass.png {rest}"), 0).0.remove(0);
        assert_eq!(row["SAE"], json!(sae), "{rest}");
    }
}

#[test]
fn a_picture_that_cannot_be_scored_stops_no_other() {
    let workshop = Workshop::new();
    workshop.paint("wide.png", 41, 30);
    workshop.write("text.png", b"This is no picture, whatever its name says.");
    let (rows, stderr) = scores(&workshop, "photo.png wide.png photo.png missing.png text.png photo.png", 3);
    assert_eq!(rows.len(), 2);
    let messages: Vec<&str> = stderr.lines().collect();
    let expected = [
        ("wide.png", "41x30 px and the reference 40x30"),
        ("missing.png", "no such file"),
        ("text.png", "not a picture"),
    ];
    assert_eq!(messages.len(), expected.len(), "{stderr}");
    for (message, (file, words)) in messages.iter().zip(expected) {
        assert!(message.starts_with(&format!("smalti: {file}: ")) && message.contains(words), "{message}");
    }
    let ran = workshop.run("score photo.png wide.png photo.png");
    assert_eq!((ran.code, table(&ran).len()), (Some(3), 2));
}

#[test]
fn without_a_reference_or_any_picture_nothing_is_scored() {
    let workshop = Workshop::new();
    workshop.paint("low.png", 40, 6);
    for (line, words) in [
        ("missing.png photo.png", "missing.png: there is no such file"),
        ("low.png low.png", "low.png: the picture has 40x6 px, fewer than the 7x7"),
        ("photo.png low.png", "low.png: the picture has 40x6 px and the reference 40x30"),
        ("photo.png", "<OUT>"),
        ("photo.png photo.png --background reddish", "--background"),
    ] {
        let ran = workshop.run(&format!("score {line}"));
        assert_eq!((ran.code, ran.stdout.len()), (Some(2), 0), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(words) && ran.stderr.lines().count() == 1, "{line}: {}", ran.stderr);
    }
    assert_eq!(scores(&workshop, "photo.png low.png missing.png", 2).0.len(), 0);
}

#[test]
fn a_photo_is_reduced_to_the_mosaic_as_evolve_reduces_it() {
    let workshop = Workshop::new();
    workshop.paint("large.png", 90, 67);
    let ran = workshop.run("evolve large.png -o m.png -o s.png --size 40 -n 60 --evals 2k --save-target target.png");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let against = |line: &str| {
        let ran = workshop.run(&format!("score {line} --json"));
        assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
        ran.stdout
    };
    assert_eq!(against("large.png m.png s.png --fit"), against("target.png m.png s.png"));
    // 90x67 px are 13x10 at that size, and 40x31 when drawn larger, which the photo alone is never reduced to.
    let line = "evolve large.png -o larger.png -n 20 --size 13 --evals 500 --output-size 40";
    assert_eq!(workshop.run(line).code, Some(0));
    assert_eq!(workshop.pixels("larger.png").dimensions(), (40, 31));
    let (rows, _) = scores(&workshop, "large.png larger.png --fit", 0);
    assert_eq!([&rows[0]["width"], &rows[0]["height"]], [40, 31]);
    workshop.paint("square.png", 40, 40);
    let ran = workshop.run("score large.png square.png --fit");
    assert!(ran.code == Some(2) && ran.stderr.contains("square.png: the picture has 40x40 px"), "{}", ran.stderr);
    let ran = workshop.run("score large.png m.png");
    assert!(ran.code == Some(2) && ran.stderr.contains("--fit reduces"), "{}", ran.stderr);
    let ran = workshop.run("score m.png large.png --fit");
    assert!(ran.code == Some(2) && ran.stderr.contains("does not enlarge"), "{}", ran.stderr);
}
