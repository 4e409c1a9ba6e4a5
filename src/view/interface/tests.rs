//! The interface, driven as a person would, without a display and without a device.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui::accesskit::Role;
use egui::{Key, Modifiers, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};

use super::{Compare, Field, Interface, Request};
use crate::evolve::StopReason;
use crate::model::{Fly, MaskSet, Population};
use crate::shapes::Shader;
use crate::view::news::{Doing, Moment, News, Note, Order, PictureNews, SaveOrder, Standing};
use crate::view::wishes::{ColorWish, GroundWish, GroutWish, MaskWish, StyleWish, Wishes};

type Window = Harness<'static, Interface>;

const SIZE: [u32; 2] = [60, 40];

/// A picture on its way: one large tile, and three moments.
fn news(doing: Doing) -> News {
    let fly = Fly { x: 1_920, y: 1_280, w: 640, h: 640, r: 0xffff, alive: true, ..Fly::ABSENT };
    let (background, masks) = ([0; 3].into(), MaskSet::default());
    let (width_px, height_px) = (SIZE[0], SIZE[1]);
    let tiles = Arc::new(Population { width_px, height_px, background, grout: None, masks, flies: vec![fly; 2_500] });
    let moment = |evals, error| Moment { evals, error, tiles: Arc::clone(&tiles) };
    let course = Arc::new(vec![moment(0, 90.0), moment(500, 40.0), moment(1_000, 20.0)]);
    let picture = PictureNews {
        serial: 1,
        name: "woman.jpg".to_owned(),
        path: Some(PathBuf::from("photos/woman.jpg")),
        size: SIZE,
        rgba: vec![200; 60 * 40 * 4],
    };
    News {
        picture: Some(Arc::new(picture)),
        tiles: Some(Arc::clone(&tiles)),
        marginal: Some(Arc::new(vec![123; 2_500])),
        error_map: Some(Arc::new(vec![9; 60 * 40])),
        doing,
        standing: Standing { evals: 1_000, evals_planned: 4_000, tile_count: 2_500, error: 20.0, evals_per_s: 5e4 },
        course,
        command: "smalti evolve photos/woman.jpg -o mosaic.png --style mosaic".to_owned(),
        device: "CPU".to_owned(),
        ..News::default()
    }
}

fn window_of(news: News) -> Window {
    let mut interface = Interface::new(Wishes::default());
    interface.hear(news, 0.0);
    let builder = Harness::builder().with_size(vec2(1_180.0, 780.0)).with_max_steps(64);
    let mut window = builder.build_ui_state(|ui, interface: &mut Interface| interface.show(ui, None), interface);
    window.run();
    window
}

fn window() -> Window {
    window_of(news(Doing::Running))
}

fn click(window: &mut Window, label: &str) {
    window.get_by_label(label).click();
    window.run();
}

fn press(window: &mut Window, key: Key) {
    window.key_press(key);
    window.run();
}

/// The wishes of the last order that has any.
fn asked(window: &mut Window) -> Option<Wishes> {
    let orders = window.state_mut().take_orders();
    orders.into_iter().rev().find_map(|order| if let Order::Ask(ask) = order { Some(ask.wishes) } else { None })
}

fn orders(window: &mut Window) -> Vec<Order> {
    window.state_mut().take_orders()
}

#[test]
fn before_a_picture_is_open_the_stage_asks_for_one_and_takes_a_path() {
    let mut window = window_of(News::default());
    window.get_by_label("Drop a picture here");
    press(&mut window, Key::B);
    assert!(!window.state().brush.is_on, "nothing is armed that nobody sees");
    click(&mut window, "Open…");
    assert!(window.get_by_label("path to open").is_focused(), "the cursor is where one types");
    window.get_by_label("path to open").type_text("photos/a b.png");
    window.run();
    click(&mut window, "Open");
    assert!(matches!(&orders(&mut window)[..], [Order::Open(path)] if path == Path::new("photos/a b.png")));
}

#[test]
fn every_style_can_be_chosen_and_takes_nothing_of_another_along() {
    let mut window = window();
    window.state_mut().wishes.masks.push(MaskWish::BuiltIn("disc"));
    window.run();
    assert_eq!(asked(&mut window).map(|wishes| wishes.masks.len()), Some(1));
    for (name, style) in [("Paint", StyleWish::Paint), ("Free", StyleWish::Free), ("Spray", StyleWish::Spray)] {
        click(&mut window, name);
        let wishes = asked(&mut window).expect("the wishes changed");
        assert_eq!((wishes.style, wishes.masks.len()), (style, 0));
    }
}

#[test]
fn the_number_of_tiles_is_typed_or_left_to_the_picture() {
    let mut window = window();
    let slider = window.get_by_role_and_label(Role::Slider, "tiles");
    assert_eq!(slider.accesskit_node().numeric_value(), Some(2_500.0));
    slider.focus();
    window.run();
    press(&mut window, Key::ArrowRight);
    let tiles = asked(&mut window).expect("it changed").tiles.expect("it is a number");
    assert!(tiles > 2_500, "{tiles}");
    click(&mut window, "automatic number");
    assert_eq!(asked(&mut window).expect("it changed").tiles, None);
}

#[test]
fn shapes_are_chosen_by_picture_and_several_are_a_mix() {
    let mut window = window();
    for name in ["disc", "hexagon"] {
        click(&mut window, name);
    }
    let mix = vec![MaskWish::BuiltIn("disc"), MaskWish::BuiltIn("hexagon")];
    assert_eq!(asked(&mut window).expect("they changed").masks, mix);
    click(&mut window, "disc");
    assert_eq!(asked(&mut window).expect("they changed").masks, mix[1..]);
    click(&mut window, "shader");
    click(&mut window, "emboss");
    assert_eq!(asked(&mut window).expect("it changed").shader, Some(Shader::Emboss));
}

#[test]
fn grout_and_background_have_all_their_kinds() {
    let mut window = window();
    for (label, grout) in [("none", GroutWish::None), ("a darker mean", GroutWish::Auto)] {
        click(&mut window, "grout");
        click(&mut window, label);
        assert_eq!(asked(&mut window).expect("it changed").grout, grout);
    }
    click(&mut window, "width of the grout");
    assert_eq!(asked(&mut window).expect("it changed").grout_width, Some(1.0));
    click(&mut window, "grout");
    click(&mut window, "this colour");
    assert!(matches!(asked(&mut window).expect("it changed").grout, GroutWish::Color(_)));
    click(&mut window, "background");
    click(&mut window, "none: transparent");
    assert_eq!(asked(&mut window).expect("it changed").ground, GroundWish::None);
}

#[test]
fn colours_bounds_and_search_are_behind_their_titles() {
    let mut window = window();
    // What is open already is closed, so that the others are on the screen.
    for title in ["Shape of the tiles", "Grout and ground", "What matters", "Colours", "Limits", "Search"] {
        click(&mut window, title);
    }
    window.run_steps(30);
    click(&mut window, "colours");
    click(&mut window, "a few of the picture");
    assert_eq!(asked(&mut window).expect("it changed").colors, ColorWish::Few(16));
    for label in ["sides", "slimness", "overlap", "gaps", "turning"] {
        click(&mut window, label);
    }
    let bounds = asked(&mut window).expect("they changed").bounds;
    assert_eq!((bounds.side, bounds.aspect), (Some([0.6, 1.6]), Some(1.6)));
    assert_eq!([bounds.overlap, bounds.hole, bounds.turn], [Some(20), Some(120), Some(60)]);
    for label in ["size", "effort"] {
        window.get_by_role_and_label(Role::Slider, label).focus();
        window.run();
        press(&mut window, Key::ArrowRight);
    }
    let wishes = asked(&mut window).expect("they changed");
    assert!(wishes.size > 512 && wishes.evals_per_tile > 400, "{wishes:?}");
    click(&mut window, "Reset all");
    assert_eq!(asked(&mut window), Some(Wishes::default()));
}

#[test]
fn a_change_is_taken_back_and_made_again_by_buttons_and_by_keys() {
    let mut window = window();
    click(&mut window, "disc");
    click(&mut window, "flower");
    let both = asked(&mut window).expect("they changed").masks;
    click(&mut window, "Undo");
    assert_eq!(asked(&mut window).expect("it is taken back").masks, both[..1]);
    window.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    window.run();
    assert_eq!(asked(&mut window).expect("it is taken back").masks, []);
    click(&mut window, "Redo");
    window.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    window.run();
    assert_eq!(asked(&mut window).expect("it is made again").masks, both);
}

#[test]
fn the_search_pauses_steps_goes_on_and_begins_anew() {
    let mut window = window();
    click(&mut window, "Pause");
    press(&mut window, Key::Space);
    click(&mut window, "Step");
    window.key_press_modifiers(Modifiers::COMMAND, Key::R);
    window.run();
    let given = orders(&mut window);
    assert!(matches!(&given[..], [Order::Pause, Order::Pause, Order::Step, Order::Restart]), "{}", given.len());
    window.state_mut().hear(news(Doing::Paused), 1.0);
    window.run();
    click(&mut window, "Go on");
    press(&mut window, Key::S);
    click(&mut window, "Restart");
    assert!(matches!(&orders(&mut window)[..], [Order::Go, Order::Step, Order::Restart]));
    window.state_mut().hear(news(Doing::Done(StopReason::Evals)), 2.0);
    window.run();
    press(&mut window, Key::Space);
    assert!(orders(&mut window).is_empty(), "a search that is over does not go on");
}

#[test]
fn photo_divider_and_error_are_one_key_or_button_away() {
    let mut window = window();
    for (label, compare) in [
        ("Divider", Compare::Divider),
        ("Photo", Compare::Photo),
        ("Error", Compare::Error),
        ("Tiles", Compare::Mosaic),
    ] {
        click(&mut window, label);
        assert_eq!(window.state().compare, compare);
    }
    press(&mut window, Key::E);
    assert_eq!((window.state().compare, window.state().looks_at().1), (Compare::Error, true));
    press(&mut window, Key::D);
    let before = window.state().divider;
    let handle = window.get_by_label("divider between photo and mosaic").rect().center();
    window.drag_at(handle);
    window.run();
    window.hover_at(handle + vec2(150.0, 0.0));
    window.run();
    window.drop_at(handle + vec2(150.0, 0.0));
    window.run();
    assert!(window.state().divider > before + 0.1, "{}", window.state().divider);
    window.key_down(Key::C);
    window.step();
    assert!(window.state().peek);
    window.key_up(Key::C);
    window.run();
    assert!(!window.state().peek);
}

#[test]
fn the_stage_is_panned_zoomed_and_fitted() {
    let mut window = window();
    let scale = |window: &Window| window.state().wanted.expect("the mosaic is on the stage").canvas.width_px;
    let fitted = scale(&window);
    press(&mut window, Key::Plus);
    assert!(scale(&window) > fitted);
    press(&mut window, Key::Num1);
    assert_eq!(scale(&window), SIZE[0]);
    press(&mut window, Key::F);
    assert_eq!(scale(&window), fitted);
    let stage = window.get_by_label("mosaic").rect();
    window.hover_at(stage.center());
    window.run();
    let scroll = egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 200.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    window.event(scroll);
    window.run();
    assert!(scale(&window) > fitted);
}

#[test]
fn the_tile_under_the_pointer_tells_its_genes_and_its_fitness() {
    let mut window = window();
    let stage = window.get_by_label("mosaic").rect();
    window.hover_at(stage.center());
    window.run();
    assert_eq!((window.state().hovered, window.state().looks_at().0), (Some(0), true));
    window.get_by_label_contains("Tile 0");
    window.get_by_label_contains("#ff0000");
    window.get_by_label("marginal fitness +123");
    window.hover_at(stage.min + vec2(3.0, 3.0));
    window.run();
    assert_eq!(window.state().hovered, None);
}

#[test]
fn the_slider_goes_back_in_time_and_returns() {
    let mut window = window();
    window.get_by_role_and_label(Role::Slider, "time").focus();
    window.run();
    press(&mut window, Key::ArrowLeft);
    assert_eq!(window.state().moment, Some(1));
    window.get_by_label_contains("error 40.00 of 255");
    click(&mut window, "Now");
    assert_eq!(window.state().moment, None);
}

#[test]
fn what_is_painted_becomes_a_map_once_the_brush_is_lifted() {
    let mut window = window();
    click(&mut window, "more");
    let stage = window.get_by_label("mosaic").rect();
    let (from, to) = (stage.center() - vec2(60.0, 0.0), stage.center() + vec2(60.0, 0.0));
    window.hover_at(from);
    window.run();
    window.drag_at(from);
    window.run_steps(3);
    window.hover_at(to);
    window.run_steps(3);
    assert!(asked(&mut window).is_none(), "the search is not disturbed while one paints");
    window.drop_at(to);
    window.run();
    let map = asked(&mut window).expect("it changed").weight.expect("there is a map");
    assert_eq!(map.size, SIZE);
    let at = |x: usize, y: usize| map.luma[y * SIZE[0] as usize + x];
    assert_eq!((at(30, 20), at(59, 0)), (255, 0));
    click(&mut window, "Clear");
    assert_eq!(asked(&mut window).expect("it changed").weight, None);
    press(&mut window, Key::B);
    assert!(!window.state().brush.is_on);
}

#[test]
fn the_form_saves_in_any_format_and_asks_before_it_replaces_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let there = folder.path().join("there.png");
    std::fs::write(&there, "x").expect("it is written");
    let mut window = window();
    window.key_press_modifiers(Modifiers::COMMAND, Key::S);
    window.run();
    assert!(window.get_by_label("file to save").accesskit_node().value().is_some_and(|path| path.contains("woman")));
    click(&mut window, "format");
    click(&mut window, "svg: vectors, one element for each tile");
    click(&mut window, "4,096");
    click(&mut window, "Save file");
    let saved = SaveOrder { path: PathBuf::from("photos/woman-mosaic.svg"), long_side_px: Some(4_096) };
    assert!(matches!(&orders(&mut window)[..], [Order::Save(save)] if *save == saved));
    window.state_mut().save.is_open = true;
    window.state_mut().save.choose(&there);
    window.state_mut().save.choose(Path::new("other.png"));
    window.run();
    let field = window.get_by_label("file to save");
    field.focus();
    window.run();
    window.key_press_modifiers(Modifiers::COMMAND, Key::A);
    window.run();
    window.get_by_label("file to save").type_text(&there.display().to_string());
    window.run();
    window.get_by_label("There is a file of this name.");
    assert!(orders(&mut window).is_empty());
    click(&mut window, "Replace the file");
    assert!(matches!(&orders(&mut window)[..], [Order::Save(save)] if save.path == there));
}

#[test]
fn failures_stay_until_they_are_closed_and_other_messages_go() {
    let mut window = window();
    let mut told = news(Doing::Running);
    told.notes = vec![Note::failure("a.png: holds no picture"), Note::done("Wrote b.png")];
    window.state_mut().hear(told, 0.0);
    window.step();
    assert_eq!(window.state().messages.texts().len(), 2);
    window.get_by_label("a.png: holds no picture.");
    for _ in 0..60 {
        window.step();
        window.state_mut().hear(news(Doing::Running), 0.0);
    }
    window.input_mut().time = Some(100.0);
    window.step();
    assert_eq!(window.state().messages.texts(), ["a.png: holds no picture"]);
    window.get_by_label("×").click();
    window.step();
    window.step();
    assert!(window.state().messages.texts().is_empty());
}

#[test]
fn the_command_is_copied() {
    let mut window = window();
    window.get_by_label("Copy command").click();
    window.step();
    window.step();
    let copied = window.output().platform_output.commands.iter().any(|command| {
        matches!(command, egui::OutputCommand::CopyText(text) if text.starts_with("smalti evolve photos/woman.jpg"))
    });
    assert!(copied || window.state().messages.texts().contains(&"The command is in the clipboard"));
}

#[test]
fn dialogs_of_the_desktop_are_asked_for_where_there_are_any() {
    let mut window = window();
    window.state_mut().has_dialogs = true;
    click(&mut window, "Open…");
    assert_eq!(window.state_mut().take_requests(), [Request::Open]);
    window.state_mut().without_dialogs(&Request::Open);
    window.run();
    window.get_by_label("path to open");
    press(&mut window, Key::Escape);
    assert!(window.query_by_label("path to open").is_none(), "Escape closes it");

    window.state_mut().has_dialogs = true;
    click(&mut window, "Own shape…");
    assert_eq!(window.state_mut().take_requests(), [Request::Field(Field::Mask)]);
    window.state_mut().choose(&Request::Field(Field::Mask), "there/is/none.svg".into());
    window.run();
    assert!(window.state().messages.texts().iter().any(|text| text.contains("none.svg")), "the path is taken");
    window.state_mut().without_dialogs(&Request::Field(Field::Mask));
    window.run();
    window.get_by_label("own shape");
}

#[test]
fn a_steered_mosaic_is_not_lost_by_one_click() {
    let mut window = window();
    assert!(window.state_mut().may_close(0.0), "nothing would be lost");
    window.state_mut().hear(News { is_unsaved: true, ..news(Doing::Running) }, 0.0);
    assert!(!window.state_mut().may_close(0.0));
    window.step();
    assert!(window.state().messages.texts()[0].contains("is not saved"));
    assert!(window.state_mut().may_close(0.0), "who asks twice means it");
}

#[test]
fn everything_has_a_name_for_those_who_do_not_see() {
    let window = window();
    for node in window.root().children_recursive() {
        let node = node.accesskit_node();
        if matches!(node.role(), Role::Button | Role::CheckBox | Role::Slider | Role::ComboBox | Role::TextInput) {
            let named = node.label().is_some_and(|label| !label.is_empty()) || node.value().is_some();
            assert!(named, "{:?} at {:?} has no name", node.role(), node.bounding_box());
        }
    }
}
