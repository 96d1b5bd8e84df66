//! Figures as PNG files: each beside its SVG, a picture with something in it.

mod common;

use std::fs;

/// Width and height that a PNG file says it has.
fn size(png: &[u8]) -> (u32, u32) {
    assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
    let number = |place: usize| u32::from_be_bytes(png[place..place + 4].try_into().unwrap());
    (number(16), number(20))
}

#[test]
fn every_figure_is_a_picture_beside_its_drawing() {
    let folder = common::TemporaryFolder::new();
    let comparison = folder.join("comparison");
    common::write_comparison(&comparison, &common::comparison());
    canter_report::report_compare(&comparison).unwrap();
    let mut num_pictures = 0;
    for entry in fs::read_dir(comparison.join("figures")).unwrap() {
        let drawing = entry.unwrap().path();
        if drawing.extension().is_none_or(|ending| ending != "svg") {
            continue;
        }
        let picture = fs::read(drawing.with_extension("png")).unwrap();
        let (width, height) = size(&picture);
        assert!(width >= 400 && height >= 100, "{} has {width} x {height} pixels", drawing.display());
        // An empty picture of this size takes fewer bytes.
        assert!(picture.len() > 4000, "{} has {} bytes", drawing.display(), picture.len());
        num_pictures += 1;
    }
    assert!(num_pictures >= 14, "{num_pictures}");
}
