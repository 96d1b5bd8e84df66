//! What a URDF needs to be a robot here: a trunk that floats, and motors.

use std::fmt::Write;

use roxmltree::{Document, Node};

use crate::robot::xml::without_comments;

/// What the link is called from which the trunk floats.
const WORLD: &str = "canter_world";

/// The URDF with its root link hung from the world by a floating joint: MuJoCo would bolt it down and forget its mass.
///
/// # Errors
/// What is wrong with the file.
pub fn afloat(text: &str) -> Result<String, String> {
    let plain = without_comments(text).map_err(|fault| fault.message)?;
    let document = Document::parse(&plain).map_err(|error| error.to_string())?;
    let robot = document.root_element();
    let of_tag = |tag: &'static str| robot.children().filter(move |node| node.has_tag_name(tag));
    let child_of = |joint: Node<'_, '_>| {
        let child = joint.children().find(|node| node.has_tag_name("child"))?;
        child.attribute("link").map(str::to_owned)
    };
    let children: Vec<String> = of_tag("joint").filter_map(child_of).collect();
    let roots: Vec<&str> = of_tag("link")
        .filter_map(|link| link.attribute("name"))
        .filter(|name| !children.iter().any(|child| child == name))
        .collect();
    let [root] = roots[..] else {
        return Err(format!("expected one link that is no joint's child, found {}", roots.len()));
    };
    let is_floating = of_tag("joint").any(|joint| joint.attribute("type") == Some("floating"));
    let mut inserted = String::new();
    if !is_floating {
        let _ = write!(
            inserted,
            "<link name=\"{WORLD}\"/><joint name=\"floating_base\" type=\"floating\"><parent link=\"{WORLD}\"/>\
             <child link=\"{root}\"/></joint>"
        );
    }
    let first = robot.first_child().ok_or("the robot has no links")?;
    let place = first.range().start;
    Ok(format!("{}{inserted}{}", &plain[..place], &plain[place..]))
}

/// The MJCF with a motor for every hinge, as its limits of torque allow: a URDF names no motors.
///
/// # Errors
/// What is wrong with the file.
pub fn with_motors(mjcf: &str) -> Result<String, String> {
    let document = Document::parse(mjcf).map_err(|error| error.to_string())?;
    let is_hinge = |node: &Node<'_, '_>| {
        node.has_tag_name("joint")
            && node.attribute("type").is_none_or(|kind| kind == "hinge")
            && node.ancestors().any(|ancestor| ancestor.has_tag_name("worldbody"))
    };
    let mut motors = String::from("  <actuator>\n");
    for name in document.descendants().filter(is_hinge).filter_map(|joint| joint.attribute("name")) {
        let _ = writeln!(motors, "    <motor name=\"{name}\" joint=\"{name}\"/>");
    }
    motors.push_str("  </actuator>\n");
    let end = mjcf.rfind("</mujoco>").ok_or("the MJCF has no end")?;
    Ok(format!("{}{motors}{}", &mjcf[..end], &mjcf[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trunk_floats_and_is_found_by_what_is_nobodys_child() {
        let urdf = "<robot name='r'>\n<link name='foot'/><joint name='j' type='fixed'><parent link='trunk'/>\
                    <child link='foot'/></joint><link name='trunk'/></robot>";
        let afloat = afloat(urdf).unwrap();
        assert!(
            afloat.contains("type=\"floating\"><parent link=\"canter_world\"/><child link=\"trunk\"/>"),
            "{afloat}"
        );
        assert!(super::afloat("<robot><link name='a'/><link name='b'/></robot>").unwrap_err().contains("found 2"));
    }

    #[test]
    fn hinges_get_motors() {
        let mjcf =
            "<mujoco><worldbody><body><joint name='a'/><joint name='b' type='slide'/></body></worldbody></mujoco>";
        let with = with_motors(mjcf).unwrap();
        assert!(with.contains("<motor name=\"a\" joint=\"a\"/>") && !with.contains("name=\"b\" joint"), "{with}");
    }
}
