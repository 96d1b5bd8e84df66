//! Numbers as source code.

/// An `f32` as C and Rust both read it, to the same bits; `suffix` is `f` in C and nothing in Rust.
///
/// # Panics
/// If it is not finite: nothing that is exported may be.
pub fn number(value: f32, suffix: &str) -> String {
    assert!(value.is_finite(), "an exported number is finite");
    format!("{value:?}{suffix}")
}

/// Numbers with commas between them.
pub fn list(values: &[f32], suffix: &str) -> String {
    values.iter().map(|&value| number(value, suffix)).collect::<Vec<_>>().join(", ")
}

/// Numbers in lines of at most 120 characters, each indented by four.
pub fn lines(values: &[f32], suffix: &str) -> String {
    const WIDTH: usize = 116;
    let mut text = String::new();
    let mut line = String::new();
    for &value in values {
        let number = number(value, suffix) + ",";
        if !line.is_empty() && line.len() + 1 + number.len() > WIDTH {
            text += &format!("    {line}\n");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += &number;
    }
    if !line.is_empty() {
        text += &format!("    {line}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_to_the_same_bits() {
        for value in [0.0, -0.0, 1.0, -0.1, 1e-30, 3.402_823_5e38, f32::MIN_POSITIVE, 1e-45] {
            assert_eq!(number(value, "").parse::<f32>().unwrap().to_bits(), value.to_bits());
        }
        assert_eq!(number(1e20, "f"), "1e20f");
        assert_eq!(list(&[1.0, -2.5], "f"), "1.0f, -2.5f");
    }

    #[test]
    fn lines_keep_to_their_width() {
        let text = lines(&[0.123_456_78; 100], "f");
        assert!(text.lines().all(|line| line.len() <= 120 && line.starts_with("    0.")));
        assert_eq!(text.matches(',').count(), 100);
    }
}
