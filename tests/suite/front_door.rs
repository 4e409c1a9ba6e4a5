//! The library as other programs use it: what it makes is what the command line makes, and nothing makes it panic.

use smalti::{Device, Error, Mask, Mosaic, Picture, Population, Recipe, Session, Shader, StopReason, make_all};

use crate::workshop::Workshop;

/// The picture that every workshop holds.
fn photo(workshop: &Workshop) -> Picture {
    Picture::open(workshop.path("photo.png")).unwrap()
}

/// A quick recipe by the search in cells.
fn quick() -> Recipe {
    Recipe::mosaic().tiles(60).evals(3_000).seed(7)
}

/// A quick recipe by the paper's scheme.
fn quick_paper() -> Recipe {
    Recipe::paper().tiles(60).births(300).seed(7)
}

fn quietly(recipe: &Recipe, picture: &Picture) -> Mosaic {
    recipe.make_quietly(picture, &Device::cpu()).unwrap()
}

/// The name that a refusal gives, and its whole sentence.
fn refused(result: Result<impl Sized, Error>) -> (String, String) {
    let error = result.err().expect("it is refused");
    let Error::Parameter { name, .. } = &error else { panic!("{error} is about no parameter") };
    (name.clone(), error.to_string())
}

#[test]
fn every_file_has_the_bytes_that_the_command_line_writes() {
    let workshop = Workshop::new();
    let files = ["png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"];
    let outputs = files.map(|ending| format!("-o a.{ending}")).join(" ");
    for (line, recipe) in [
        ("--style mosaic -n 60 --evals 3000 --seed 7", quick()),
        ("--style spray -n 60 --evals 3000 --seed 7", Recipe::spray().tiles(60).evals(3_000).seed(7)),
        ("--scheme paper -n 60 --births 300 --seed 7", quick_paper()),
        (
            "-n 60 --evals 3000 --mask disc --shader flat --colors 5 --background 0a141e",
            Recipe::new()
                .tiles(60)
                .evals(3_000)
                .masks([Mask::named("disc").unwrap()])
                .shader(Shader::Flat)
                .colors(5)
                .background([10, 20, 30]),
        ),
    ] {
        let ran = workshop.run(&format!("evolve photo.png {outputs} {line} --force"));
        assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
        let mosaic = quietly(&recipe, &photo(&workshop));
        let made = [
            mosaic.png(),
            mosaic.jpeg(),
            mosaic.webp(),
            mosaic.svg(),
            mosaic.ora(),
            mosaic.npz(),
            mosaic.csv(),
            mosaic.json(),
        ];
        for (ending, made) in files.iter().zip(made) {
            assert!(made.unwrap() == workshop.read(&format!("a.{ending}")), "{line}: {ending}");
            mosaic.save(workshop.path(&format!("saved.{ending}"))).unwrap();
            assert!(workshop.read(&format!("saved.{ending}")) == workshop.read(&format!("a.{ending}")), "{ending}");
        }
    }
}

#[test]
fn a_mosaic_drawn_larger_has_the_bytes_that_the_command_line_writes() {
    let workshop = Workshop::new();
    let line = "evolve photo.png -o a.png --output-size 100 --style mosaic -n 60 --evals 3000 --seed 7";
    assert_eq!(workshop.run(line).code, Some(0));
    let mosaic = quietly(&quick(), &photo(&workshop));
    let large = mosaic.resized(100, &Device::cpu()).unwrap();
    assert!(large.png().unwrap() == workshop.read("a.png"));
    assert_ne!(large.key(), mosaic.key());
    assert_eq!(large.resized(40, &Device::cpu()).unwrap().png().unwrap(), mosaic.png().unwrap());
    let image = large.image().unwrap();
    assert_eq!((image.width_px, image.height_px, image.rgb8().len()), (100, 75, 22_500));
    assert_eq!(image.rgba8()[..4], [image.pixels[0][0], image.pixels[0][1], image.pixels[0][2], 255]);
}

#[test]
fn a_callback_changes_no_byte_and_may_end_the_work() {
    let workshop = Workshop::new();
    let picture = photo(&workshop);
    for recipe in [quick(), quick_paper()] {
        let (mut shares, mut calls) = (vec![], 0);
        let watched = recipe
            .make(&picture, &Device::cpu(), |progress| {
                calls += 1;
                shares.push(progress.share());
                let tiles = progress.tiles().unwrap();
                assert_eq!(tiles.len(), progress.population().unwrap().flies.iter().filter(|fly| fly.alive).count());
                assert!(progress.sae().unwrap() > 0 && progress.births() <= progress.evals());
                true
            })
            .unwrap();
        assert!(watched.png().unwrap() == quietly(&recipe, &picture).png().unwrap());
        assert!(
            shares.is_sorted() && calls > 1 && shares.iter().all(|share| (0.0..=1.0).contains(share)),
            "{shares:?}"
        );
        let stopped = recipe.make(&picture, &Device::cpu(), |progress| progress.share() < 0.5).unwrap();
        assert_eq!(stopped.stop_reason(), StopReason::Interrupted);
        assert!((1..watched.evals()).contains(&stopped.evals()), "{} evals", stopped.evals());
        assert!(stopped.tiles().count() > 0);
    }
}

#[test]
fn a_callback_is_called_often_enough_for_a_smooth_window() {
    // Ten calls a second, on a machine that makes 50,000 evals a second.
    let pixels: Vec<u8> =
        (0..512 * 384_u64).flat_map(|i| [(i % 512) as u8, (i / 512) as u8, (i * i % 251) as u8]).collect();
    let picture = Picture::from_rgb8(512, 384, &pixels).unwrap();
    let mut evals_by_call = vec![0];
    let recipe = Recipe::new().tiles(1_000).evals(40_000);
    let mosaic = recipe
        .make(&picture, &Device::cpu(), |progress| {
            evals_by_call.push(progress.evals());
            true
        })
        .unwrap();
    let longest = evals_by_call.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    assert!(longest <= 5_000, "{longest} evals of {} passed without a call", mosaic.evals());
}

#[test]
fn the_same_pixels_have_the_same_key_and_others_another() {
    let rgb: Vec<u8> = (0..36).collect();
    let one = Picture::from_rgb8(4, 3, &rgb).unwrap();
    let same = Picture::from_rgb8(4, 3, &rgb).unwrap();
    let turned = Picture::from_rgb8(3, 4, &rgb).unwrap();
    let with_alpha: Vec<u8> = rgb.chunks(3).flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]).collect();
    let opaque = Picture::from_rgba8(4, 3, &with_alpha).unwrap();
    assert_eq!(one.sha256(), same.sha256());
    assert_eq!(one.size_px(), (4, 3));
    for other in [&turned, &opaque] {
        assert_ne!(one.sha256(), other.sha256());
    }
    let recipe = Recipe::new().tiles(5).evals(50);
    let key = |recipe: &Recipe, picture: &Picture| quietly(recipe, picture).key().to_owned();
    assert_eq!(key(&recipe, &one), key(&recipe, &same));
    assert_ne!(key(&recipe, &one), key(&recipe, &opaque));
    assert_eq!(quietly(&recipe, &one).image().unwrap(), quietly(&recipe, &opaque).image().unwrap());
    let svg = |side| {
        format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect width="{side}" height="9"/></svg>"#)
    };
    let mask = |side| Mask::from_encoded(svg(side).as_bytes()).unwrap();
    let weights = |first| [first].into_iter().chain([9; 11]).collect::<Vec<u8>>();
    let first = quietly(&recipe, &one).population().clone();
    let mut second = first.clone();
    second.flies.iter_mut().for_each(|fly| fly.angle ^= 0x4000);
    for (this, other) in [
        (recipe.clone().masks([mask(4)]), recipe.clone().masks([mask(5)])),
        (recipe.clone().palette(&[[0; 3], [9; 3]]), recipe.clone().palette(&[[0; 3], [8; 3]])),
        (recipe.clone().weight(weights(9)), recipe.clone().weight(weights(255))),
        (Recipe::new().evals(50).init(first), Recipe::new().evals(50).init(second)),
    ] {
        assert_eq!(key(&this, &one), key(&this, &same));
        assert_ne!(key(&this, &one), key(&other, &one), "{this:?}");
    }
}

#[test]
fn a_file_and_its_bytes_are_the_same_picture() {
    let workshop = Workshop::new();
    let from_bytes = Picture::from_encoded(&workshop.read("photo.png")).unwrap();
    assert_eq!(from_bytes.sha256(), photo(&workshop).sha256());
    assert!(quietly(&quick(), &from_bytes).npz().unwrap() == quietly(&quick(), &photo(&workshop)).npz().unwrap());
}

#[test]
fn a_session_that_is_left_alone_makes_what_make_makes() {
    let workshop = Workshop::new();
    let (picture, device) = (photo(&workshop), Device::cpu());
    for recipe in [quick(), quick_paper()] {
        let mut session = Session::begin(&recipe, &picture, &device).unwrap();
        let mut evals = vec![];
        let stop = loop {
            if let Some(stop) = session.step().unwrap() {
                break stop;
            }
            evals.push(session.evals());
            assert!(!session.tiles().unwrap().is_empty() || session.births() == 0);
        };
        assert!(evals.is_sorted() && session.share() >= 1.0, "{evals:?}");
        assert_eq!(session.step().unwrap(), Some(stop), "an ended session stays ended");
        let mosaic = session.finish().unwrap();
        assert!(mosaic.npz().unwrap() == quietly(&recipe, &picture).npz().unwrap());
        assert!(mosaic.png().unwrap() == quietly(&recipe, &picture).png().unwrap());
    }
}

#[test]
fn a_session_goes_on_from_its_tiles_when_its_recipe_changes() {
    let workshop = Workshop::new();
    let (picture, device) = (photo(&workshop), Device::cpu());
    let changed = quick().grout_width(1.0).evals(6_000);
    let run = || {
        let mut session = Session::begin(&quick(), &picture, &device).unwrap();
        for _ in 0..3 {
            session.step().unwrap();
        }
        let (evals, tiles) = (session.evals(), session.tiles().unwrap());
        session.change(&changed).unwrap();
        assert_eq!((session.evals(), session.tiles().unwrap()), (evals, tiles), "nothing is lost");
        while session.step().unwrap().is_none() {}
        session.finish().unwrap()
    };
    let (one, two) = (run(), run());
    assert!(one.npz().unwrap() == two.npz().unwrap());
    assert!((6_000..7_000).contains(&one.evals()), "{} evals in all", one.evals());
    assert_ne!(one.key(), quietly(&changed, &picture).key(), "the key tells of the change");
    assert_eq!(
        one.population().grout.map(|grout| grout.width),
        quietly(&changed, &picture).population().grout.map(|grout| grout.width)
    );
}

#[test]
fn a_change_that_needs_a_new_beginning_is_refused_and_loses_nothing() {
    let workshop = Workshop::new();
    let (picture, device) = (photo(&workshop), Device::cpu());
    let mut session = Session::begin(&quick(), &picture, &device).unwrap();
    session.step().unwrap();
    let tiles = session.tiles().unwrap();
    for (recipe, field) in [
        (quick().tiles(61), "tiles"),
        (quick().size(20), "size"),
        (quick_paper(), "scheme"),
        (quick().opacity(0.5), "blend"),
        (quick().candidates(65), "candidates"),
    ] {
        assert_eq!(refused(session.change(&recipe)).0, field);
        assert_eq!(session.tiles().unwrap(), tiles);
    }
}

#[test]
fn a_folder_on_one_device_gives_each_picture_its_own_bytes() {
    let workshop = Workshop::new();
    workshop.paint("wide.png", 50, 20);
    let pictures = [photo(&workshop), Picture::open(workshop.path("wide.png")).unwrap()];
    let recipes = [quick(), quick_paper(), Recipe::spray().tiles(40).evals(1_000)];
    let pairs: Vec<(Picture, Recipe)> =
        recipes.iter().flat_map(|recipe| pictures.iter().map(|picture| (picture.clone(), recipe.clone()))).collect();
    let alone: Vec<Vec<u8>> = pairs.iter().map(|(picture, recipe)| quietly(recipe, picture).npz().unwrap()).collect();
    for device in [Device::cpu(), Device::named("name:llvmpipe").unwrap()] {
        let broken = || Picture::open(workshop.path("none.png")).map(|picture| (picture, quick()));
        let tasks = pairs.iter().cloned().map(Ok).chain(std::iter::once_with(broken));
        let mut made = vec![None; pairs.len()];
        let mut refusals = vec![];
        let keep = |number: usize, mosaic: smalti::Result<Mosaic>| {
            match mosaic {
                Ok(mosaic) => made[number] = Some(mosaic.npz().unwrap()),
                Err(error) => refusals.push((number, error.to_string())),
            }
            true
        };
        make_all(&device, tasks, || true, keep).unwrap();
        assert!(made.iter().map(Option::as_ref).eq(alone.iter().map(Some)), "on {}", device.label());
        assert!(matches!(&refusals[..], [(6, sentence)] if sentence.contains("none.png: there is no such file")));
    }
    let mut count = 0;
    let first = |_, _| {
        count += 1;
        false
    };
    make_all(&Device::cpu(), pairs.iter().cloned().map(Ok), || true, first).unwrap();
    assert_eq!(count, 1, "nothing is told after the end");
    for device in [Device::cpu(), Device::named("name:llvmpipe").unwrap()] {
        // Hours of work, which nobody wants.
        let tasks = pictures.iter().map(|picture| Ok((picture.clone(), quick().evals(1_000_000_000))));
        make_all(&device, tasks, || false, |number, _| panic!("{number} was made on {}", device.label())).unwrap();
    }
}

#[test]
fn a_population_in_memory_is_begun_from_or_refused() {
    let workshop = Workshop::new();
    let picture = photo(&workshop);
    let population = quietly(&quick(), &picture).population().clone();
    let on =
        |population: Population| Recipe::mosaic().evals(500).init(population).make_quietly(&picture, &Device::cpu());
    let further = on(population.clone()).unwrap();
    assert_eq!(further.population().flies.len(), 60);
    std::fs::write(workshop.path("a.npz"), quietly(&quick(), &picture).npz().unwrap()).unwrap();
    let from_file = quietly(&Recipe::mosaic().evals(500).init_file(workshop.path("a.npz")), &picture);
    assert!(further.npz().unwrap() == from_file.npz().unwrap());

    let changed = |change: fn(&mut Population)| {
        let mut population = population.clone();
        change(&mut population);
        population
    };
    for (wrong, expected) in [
        (changed(|population| population.width_px = 0), "0x30 px"),
        (changed(|population| population.flies.clear()), "no flies"),
        (changed(|population| population.flies[3].mask = 9), "wears mask 9"),
        (changed(|population| population.flies = vec![population.flies[0]; 1_000_001]), "limit of 1000000"),
    ] {
        let (name, sentence) = refused(on(wrong));
        assert!(name == "init" && sentence.contains(expected), "{sentence}");
    }
    let outside = changed(|population| {
        let fly = &mut population.flies[0];
        (fly.x, fly.y, fly.z, fly.w, fly.h) = (i32::MIN, i32::MAX, u32::MAX, 0, u32::MAX);
    });
    let clamped = on(outside).unwrap();
    assert!(clamped.population().flies.iter().all(|fly| *fly == fly.clamped(40, 30)));
}

#[test]
fn what_cannot_be_is_refused_by_its_name() {
    let (device, picture) = (Device::cpu(), Picture::from_rgb8(1, 1, &[1, 2, 3]).unwrap());
    assert_eq!(refused(Recipe::named("cubist")).0, "preset");
    assert!(Recipe::named("paper-12").is_ok() && Recipe::named("free").is_ok());
    assert_eq!(refused(Mask::named("heart")).0, "mask");
    assert_eq!(refused(Mask::from_encoded(b"<svg")).0, "mask");
    assert_eq!(refused(Mask::from_encoded(b"")).0, "mask");
    assert!(Device::named("nobody's").is_err());
    assert_eq!(refused(Recipe::new().palette(&[]).check()).0, "palette");
    assert_eq!(refused(Recipe::new().palette(&[[0; 3]; 257]).check()).0, "palette");
    assert_eq!(refused(Recipe::new().weight(vec![1, 2]).make_quietly(&picture, &device)).0, "weight");
    assert_eq!(refused(Recipe::new().weight_encoded(vec![1, 2]).make_quietly(&picture, &device)).0, "weight");
    assert_eq!(refused(Recipe::mosaic().births(5).check()).0, "births");
    assert_eq!(refused(Recipe::paper().evals(5).check()).0, "evals");
    let clear = Picture::from_rgba8(1, 1, &[0; 4]).unwrap();
    assert_eq!(refused(Recipe::new().make_quietly(&clear, &device)).0, "picture");
    let mosaic = quietly(&Recipe::new().tiles(2).evals(9), &picture);
    assert_eq!(refused(mosaic.jpeg_of_quality(0)).0, "quality");
    assert_eq!(refused(mosaic.resized(0, &device)).0, "output_size");
    assert_eq!(refused(mosaic.resized(65_536, &device)).0, "output_size");
    assert!(mosaic.save("mosaic.xyz").unwrap_err().to_string().starts_with("mosaic.xyz: does not end in .png"));
    // A line, since its square would take a minute to draw.
    let line = quietly(&Recipe::new().tiles(2).evals(9), &Picture::from_rgb8(256, 1, &[9; 768]).unwrap());
    assert_eq!(refused(line.resized(16_384, &device).unwrap().webp()).0, "output_size");
}

#[test]
fn a_session_changes_its_masks_and_goes_back_to_squares() {
    let workshop = Workshop::new();
    let (picture, device) = (photo(&workshop), Device::cpu());
    let discs = quick().masks([Mask::named("disc").unwrap()]);
    let mut session = Session::begin(&discs, &picture, &device).unwrap();
    session.step().unwrap();
    assert!(session.tiles().unwrap().iter().all(|tile| tile.mask() > 0));
    session.change(&quick()).unwrap();
    session.step().unwrap();
    assert!(session.tiles().unwrap().iter().all(|tile| tile.mask() == 0));
    let mosaic = session.finish().unwrap();
    assert_eq!(mosaic.population().masks, quietly(&quick(), &picture).population().masks);
}

#[test]
fn absent_flies_of_a_population_may_wear_what_the_recipe_does_not_have() {
    let workshop = Workshop::new();
    let picture = photo(&workshop);
    let masks = ["disc", "flower", "triangle"].map(|name| Mask::named(name).unwrap());
    let recipe = Recipe::paper().tiles(40).births(50).masks(masks);
    let mut population = quietly(&recipe, &picture).population().clone();
    for fly in &mut population.flies[1..] {
        (fly.alive, fly.mask) = (false, 3);
    }
    for recipe in [Recipe::paper().births(200).p_crossover(0.5), Recipe::new().evals(2_000)] {
        let mosaic = quietly(&recipe.init(population.clone()).masks([Mask::named("disc").unwrap()]), &picture);
        assert!(mosaic.tiles().all(|tile| usize::from(tile.mask()) < mosaic.population().masks.layers().len()));
    }
}
