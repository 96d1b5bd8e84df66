//! Written files, and descriptions.

use super::*;
use crate::settings::{describe, write_commented, write_plain};

#[test]
fn plain_file_has_every_value() {
    assert_eq!(
        write_plain(&read(VALID).unwrap()),
        r#"gamma = 0.99
num_epochs = 5
seed = 18446744073709551615
offset = -3
num_envs = 16
learning_rate = 1.0
is_adaptive = true
label = "a \"b\" \u007F ü"
footfall = "trot"
widths = [64, 128]
matrix = [[1.0, 2.0], []]

[prior]
kind = "sine"
swing_amplitude_rad = 0.4
phase_offsets = [0.0, 0.5]

[[legs]]
foot = "FL"
link_lengths_m = [0.09, 0.16]

[[legs]]
foot = "FR"
link_lengths_m = [0.09, 0.16]

[legs.mount]
position_m = 1e-7
"#
    );
}

#[test]
fn commented_file_explains_every_value() {
    let text = write_commented(&read(VALID).unwrap());
    let expected = r#"# Discount factor per env step. Close to 1 for long horizons, that is when the reward of an action
# comes many steps later.
#
# See the paper.
# Range: from 0 to 1.
gamma = 0.99
# Passes over one rollout.
# Range: from 1 to 100.
num_epochs = 5
# Clip range of eq. 3.
# Range: from 0 to 1.
# clip_epsilon is optional and not set.
# Seed of every stream.
seed = 18446744073709551615
"#;
    assert!(text.starts_with(expected), "{text}");
    let expected = r#"# Which legs move together.
# - "trot": Diagonal pairs.
# - "bound": Front and rear pairs.
footfall = "trot"
"#;
    assert!(text.contains(expected), "{text}");
    let expected = r#"
# The gait.
[prior]
# - "sine": Equation 4.
# - "table": Any hand-made gait.
kind = "sine"
# Amplitude of the swing [rad].
# Range: at least 0 and below 1.5.
swing_amplitude_rad = 0.4
"#;
    assert!(text.contains(expected), "{text}");
    assert_eq!(text.matches("# Name of the foot's geom.").count(), 1);
}

#[test]
fn written_files_read_back_as_the_same_value() {
    let mut settings = read(VALID).unwrap();
    for _ in 0..2 {
        assert_eq!(read(&write_commented(&settings)).unwrap(), settings);
        assert_eq!(read(&write_plain(&settings)).unwrap(), settings);
        settings.clip_epsilon = Some(0.0);
        settings.offset = i64::MIN;
        settings.label = "\u{0}\t\r\n\\ \u{85} '''\"\"\" #".to_owned();
        settings.widths = vec![1024; 200];
        settings.matrix = vec![vec![-0.0, f64::MAX, f64::MIN_POSITIVE, 5e-324, 1e16, 123456789.125]; 4];
        settings.legs.clear();
        settings.names = Some(vec!["]".to_owned(); 90]);
        settings.prior = PriorSettings::Table(TableSettings { file: String::new() });
    }
    let text = write_plain(&settings);
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert!(text.contains("legs = []\n"));
}

#[test]
fn floats_are_written_with_the_fewest_digits_that_read_back() {
    let mut settings = read(VALID).unwrap();
    settings.learning_rate = 0.1;
    assert!(write_plain(&settings).contains("learning_rate = 0.1\n"));
    // Odd multiplier modulo 2^32: the bit patterns of floats of every size.
    for bits in (0..2000u32).map(|index| index.wrapping_mul(2_654_435_761) >> 1) {
        settings.learning_rate = f32::from_bits(bits);
        if settings.learning_rate > 0.0 && settings.learning_rate.is_finite() {
            assert_eq!(read(&write_plain(&settings)).unwrap().learning_rate.to_bits(), bits);
        }
    }
}

#[test]
fn tables_in_nested_arrays_are_written_inline() {
    settings! {
        struct Nested {
            pub rows: Vec<Vec<PriorSettings>>,
            pub empty: Empty,
        }
    }
    settings! {
        struct Empty {}
    }
    let table = PriorSettings::Table(TableSettings { file: "a.csv".to_owned() });
    let nested = Nested { rows: vec![vec![table]], empty: Empty {} };
    let text = write_plain(&nested);
    assert_eq!(text, "rows = [[{ kind = \"table\", file = \"a.csv\" }]]\n\n[empty]\n");
    assert_eq!(Document::parse("x.toml", text.as_bytes()).unwrap().read::<Nested>().unwrap(), nested);
    let report = Document::parse("x.toml", b"rows = []\nempty.x = 1").unwrap().read::<Nested>().unwrap_err();
    assert_eq!(report.to_string(), "x.toml:2:7: empty.x = 1 is not a known key: there are no keys here");
}

#[test]
fn descriptions_list_every_setting() {
    let lines: Vec<String> = describe::<AllSettings>()
        .iter()
        .map(|d| format!("{} | {} | {} | {}", d.key, d.type_name, d.range, d.when))
        .collect();
    let expected = r#"gamma | number | from 0 to 1 | 
prior | table |  | 
prior.kind | choice | "sine", "table" | 
prior.swing_amplitude_rad | number | at least 0 and below 1.5 | prior.kind = "sine"
prior.phase_offsets | array of numbers | at least 0 and below 1 | prior.kind = "sine"
prior.file | string |  | prior.kind = "table"
num_epochs | integer | from 1 to 100 | 
clip_epsilon | optional number | from 0 to 1 | 
seed | integer |  | 
offset | integer | below 10 | 
num_envs | integer | at least 1 | 
learning_rate | number | above 0 | 
is_adaptive | boolean |  | 
label | string |  | 
footfall | choice | "trot", "bound" | 
widths | array of integers | from 1 to 1024 | 
matrix | array of arrays of numbers |  | 
legs | array of tables |  | 
legs[].foot | string |  | 
legs[].link_lengths_m | array of numbers | above 0 | 
legs[].mount | optional table |  | 
legs[].mount.position_m | number |  | 
names | optional array of strings |  | "#;
    assert_eq!(lines.join("\n"), expected);
    let footfall = &describe::<AllSettings>()[14];
    assert_eq!(
        footfall.doc,
        "Which legs move together.\n- \"trot\": Diagonal pairs.\n- \"bound\": Front and rear pairs."
    );
}
