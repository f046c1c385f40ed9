use super::*;

fn example() -> Figure {
    Figure {
        id: "t".into(),
        title: "thrust & speed".into(),
        x_label: "rev/min".into(),
        y_label: "N".into(),
        layers: vec![
            Layer::Spans { name: "plateaus".into(), ranges: vec![(0.0, 1.0)] },
            Layer::Band { name: "95 %".into(), class: "a", x: vec![0.0, 2.0], lower: vec![0.0, 1.0], upper: vec![1.0, 2.0] },
            Layer::Line { name: "fit".into(), class: "a", x: vec![0.0, 1.0, 2.0], y: vec![0.5, f64::NAN, 1.5] },
            Layer::Marks {
                name: "means".into(),
                class: "b",
                marks: vec![Mark { x: 1.0, y: 1.0, error: 0.1, text: "1.0 < 2".into() }],
            },
        ],
        ..Figure::default()
    }
}

#[test]
fn markup_is_balanced_and_escaped() {
    for text in [example().svg(), example().file()] {
        assert!(text.contains("thrust &amp; speed") && text.contains("1.0 &lt; 2") && !text.contains("NaN"));
        for tag in ["g", "text", "title"] {
            let open = text.matches(&format!("<{tag} ")).count() + text.matches(&format!("<{tag}>")).count();
            assert_eq!(open, text.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
    assert!(example().file().contains("prefers-color-scheme:dark"), "a file of its own carries its colours");
    assert!(!example().svg().contains("<style>"));
}

/// A line that stands still beside one that moves by a hundredth: both fill the height.
#[test]
fn a_level_line_leaves_the_scale_to_the_others() {
    let line = |y: [f64; 2]| Layer::Line { name: String::new(), class: "a", x: vec![0.0, 1.0], y: y.to_vec() };
    let figure = Figure { layers: vec![line([8.5, 8.5]), line([8.5, 8.51])], ..Figure::default() };
    let (low, high) = figure.frame().y;
    assert!(low > 8.49 && high < 8.52, "{low} {high}");
    let alone = Figure { layers: vec![line([8.5, 8.5])], ..Figure::default() }.frame().y;
    assert!(alone.0 < 8.0 && alone.1 > 9.0, "{alone:?}");
}

/// Points over categories do not lie on the axis, columns stand on it.
#[test]
fn points_have_room_above_the_names_of_categories() {
    let mark = |x: f64, y: f64| Mark { x, y, error: 0.0, text: String::new() };
    let marks = Layer::Marks { name: String::new(), class: "a", marks: vec![mark(0.0, 0.45), mark(1.0, 0.53)] };
    let columns = Layer::Columns { name: String::new(), class: "a", place: (0, 1), values: vec![(0, 1.0, String::new())] };
    let low =
        |layer: Layer| Figure { layers: vec![layer], categories: vec!["1".into(), "2".into()], ..Figure::default() }.frame().y.0;
    assert!(low(marks) < 0.449 && low(columns) == 0.0);
}

/// Names that are wider than their places stand on rows by turns, with the same drawing above them.
#[test]
fn names_of_categories_do_not_collide() {
    let names = ["9x4.5x3", "9x4.7", "10x4.5", "11x4.5", "11x4.7", "12x4.5"].map(str::to_owned);
    let columns = Layer::Columns { name: String::new(), class: "a", place: (0, 1), values: vec![(0, 1.0, String::new())] };
    let figure = Figure { layers: vec![columns], categories: names.to_vec(), ..Figure::default() };
    let phone = Figure { captioned: true, ..figure.clone() };
    let rows = |f: &Figure| {
        let svg = f.svg();
        let of = |name: &String| {
            svg.split(&format!("\">{name}</text>")).next().and_then(|s| s.rsplit("y=\"").next().map(str::to_owned))
        };
        let all: Vec<Option<String>> = names.iter().map(of).collect();
        assert!(all.iter().all(Option::is_some), "{svg}");
        let drawn = f.frame().height - f.frame().bottom - f.frame().top;
        (all[0] != all[1], all[0] == all[2], drawn)
    };
    let [wide, narrow] = [rows(&figure), rows(&phone)];
    assert_eq!((wide.0, narrow.0, narrow.1), (false, true, true));
    assert!((wide.2 - narrow.2).abs() < 1e-9, "the drawing keeps its height");
}

#[test]
fn nothing_to_show_is_said() {
    assert!(Figure::default().is_empty());
    assert!(!example().is_empty());
}

/// A label that is longer than the drawing is high, in the letters of a phone, stands on two lines.
#[test]
fn no_label_is_cut_off() {
    let of = |label: &str, captioned: bool| Figure { y_label: label.into(), captioned, ..example() }.svg();
    let long = "time constant as it speeds up, s";
    assert!(of(long, true).contains("time constant as</tspan>") && of(long, true).contains(">it speeds up, s</tspan>"));
    for one_line in [of(long, false), of("left over, N", true)] {
        assert!(!one_line.contains("tspan"), "{one_line}");
    }
}

/// What is told by colour is told without it: the legend's marks of what stands before and after are of two kinds.
#[test]
fn before_and_after_differ_without_colour() {
    let dots = |class: &'static str| Layer::Dots { name: class.to_owned(), class, x: vec![0.0, 1.0], y: vec![0.0, 1.0] };
    let svg = Figure { layers: vec![dots("a"), dots("b")], ..Figure::default() }.svg();
    assert!(svg.contains("<circle class=\"a spot\"") && svg.contains("<rect class=\"b spot\""), "{svg}");
    let wide =
        |rule: &str| super::super::style::DRAWING.split(rule).nth(1).unwrap().split('}').next().unwrap().parse::<f64>().unwrap();
    assert!(wide("path.a{stroke-width:") > 1.5 * wide("path.b{stroke-width:"));
}

/// A read-out near an edge must not be cut off.
#[test]
fn read_outs_stay_inside() {
    let mut out = String::new();
    let f = Frame { x: (0.0, 1.0), y: (0.0, 1.0), left: LEFT, top: TOP, bottom: BOTTOM, height: 330.0 };
    mark(&mut out, "a", &Mark { x: 1.0, y: 1.0, error: 0.0, text: "a read-out of forty characters, about so".into() }, &f);
    let number = |key: &str| -> f64 {
        out.split("class=\"tip\"").nth(1).unwrap().split(key).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    assert!(number("x=\"") >= 0.0 && number("x=\"") + number("width=\"") <= WIDTH);
    assert!(number("y=\"") >= 0.0);
}
