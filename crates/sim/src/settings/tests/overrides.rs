//! `--set key=value`.

use super::*;

fn read_with(overrides: &[(&str, &str)]) -> Result<AllSettings, Problems> {
    let mut document = Document::parse("doggo.toml", VALID.as_bytes()).unwrap();
    for (key, value) in overrides {
        document.set(key, value);
    }
    document.read()
}

fn report_with(key: &str, value: &str) -> String {
    read_with(&[(key, value)]).unwrap_err().to_string()
}

#[test]
fn overrides_replace_values() {
    let settings = read_with(&[
        ("gamma", "0.5"),
        ("gamma", "0.95"),
        ("clip_epsilon", "0.2"),
        ("footfall", "bound"),
        ("label", "runs/a-1.x"),
        ("widths", "[1, 2, 3]"),
        ("widths[2]", "4"),
        ("matrix[0][1]", "7"),
        ("legs[0].foot", "\"new foot\""),
        ("legs[0].mount.position_m", "2"),
        ("prior", "{ kind = \"table\", file = \"a.csv\" }"),
        ("prior.file", "b.csv"),
    ])
    .unwrap();
    assert_eq!(settings.gamma, 0.95);
    assert_eq!(settings.clip_epsilon, Some(0.2));
    assert_eq!(settings.footfall, Footfall::Bound);
    assert_eq!(settings.label, "runs/a-1.x");
    assert_eq!(settings.widths, [1, 2, 4]);
    assert_eq!(settings.matrix[0], [1.0, 7.0]);
    assert_eq!(settings.legs[0].foot, "new foot");
    assert_eq!(settings.legs[0].mount, Some(MountSettings { position_m: 2.0 }));
    assert_eq!(settings.prior, PriorSettings::Table(TableSettings { file: "b.csv".to_owned() }));
}

#[test]
fn override_problems_show_the_override() {
    let cases = [
        ("gamma", "1.5", "--set gamma=1.5: gamma = 1.5 is out of range: expected a number from 0 to 1"),
        ("gamma", "high", "--set gamma=high: gamma = \"high\" has the wrong type: expected a number from 0 to 1"),
        ("gama", "1", "--set gama=1: gama = 1 is not a known key: did you mean \"gamma\"?"),
        (
            "priors.kind",
            "sine",
            "--set priors.kind=sine: priors = (a table) is not a known key: did you mean \"prior\"?",
        ),
        ("gamma.x", "1", "--set gamma.x=1: gamma.x cannot be set: there is no table to hold \"x\""),
        ("gamma[0]", "1", "--set gamma[0]=1: gamma[0] cannot be set: there is no array to hold [0]"),
        (
            "legs[2].foot",
            "F",
            "--set legs[2].foot=F: legs[2].foot cannot be set: index 2 is past the end of 2 elements",
        ),
        ("widths", "[1", "--set widths=[1: widths not valid TOML: unclosed array, expected `]`"),
    ];
    for (key, value, expected) in cases {
        assert_eq!(report_with(key, value), expected);
    }
}

#[test]
fn bad_keys_are_refused() {
    for key in ["", ".", "a.", "a..b", "[0]", "a[", "a[x]", "a[0", "a[0]b", "a b", "a[-1]"] {
        let expected = format!("--set {key}=1: cannot be set: expected a key like ppo.gamma or legs[2].foot");
        assert_eq!(report_with(key, "1"), expected);
    }
}

#[test]
fn bad_values_are_refused() {
    for value in ["", "1 2", "1\nseed = 3", "two words", "a=b", "'"] {
        let report = report_with("gamma", value);
        assert!(report.contains("not valid TOML"), "{report}");
    }
}

#[test]
fn problems_of_file_and_overrides_come_together() {
    let text = VALID.replace("gamma = 0.99", "gamma = 2");
    let mut document = Document::parse("doggo.toml", text.as_bytes()).unwrap();
    document.set("seed", "-1");
    document.set("widths[9]", "1");
    let report = document.read::<AllSettings>().unwrap_err().to_string();
    assert_eq!(
        report,
        "doggo.toml:1:9: gamma = 2 is out of range: expected a number from 0 to 1\n\
         --set widths[9]=1: widths[9] cannot be set: index 9 is past the end of 2 elements\n\
         --set seed=-1: seed = -1 is out of range: expected an integer from 0 to 18446744073709551615\n\
         3 problems"
    );
}
