//! What the replay's script needs of a recorded episode, in few bytes.

use serde_json::{Value, json};

use crate::figures::recorded::Recorded;
use crate::motion::{body_box, near_legs, side_view, way_along_heading};

/// The data of all gaits as JSON that cannot end the script element that it stands in.
///
/// `frames` holds for each step: the body's way forward, its way along its heading, its height [mm] and its pitch [mrad];
/// for each leg hip, both knees and foot, forward and up [mm] from the body; and one bit a foot on the ground. Each number but the last is the difference from the step
/// before.
pub fn data(recorded: &[Recorded<'_>]) -> String {
    let gaits: Vec<Value> = recorded
        .iter()
        .map(|(subject, trajectory)| {
            let (half_length, half_thickness) = body_box(trajectory);
            let mut frames: Vec<i64> = Vec::new();
            let mut before: Vec<i64> = Vec::new();
            for (step, way) in way_along_heading(trajectory).into_iter().enumerate() {
                let origin = trajectory.position_m[step];
                let mut now = vec![
                    millimetres(origin[0]),
                    millimetres(way),
                    millimetres(origin[2]),
                    millimetres(trajectory.orientation_rad[step][1]),
                ];
                for leg in 0..trajectory.legs.len() {
                    let [front, back] = trajectory.knee_m[step][leg];
                    for point in [trajectory.hip_m[step][leg], front, back, trajectory.foot_m[step][leg]] {
                        let (forward, up) = side_view(trajectory, step, point);
                        now.extend([millimetres(forward), millimetres(up - origin[2])]);
                    }
                }
                before.resize(now.len(), 0);
                frames.extend(now.iter().zip(&before).map(|(now, before)| now - before));
                before = now;
                let contacts = trajectory.contact[step].iter().enumerate();
                frames.push(contacts.map(|(leg, &touches)| i64::from(touches != 0) << leg).sum());
            }
            json!({
                "label": subject.label,
                "tone": subject.tone.number(),
                "dt": trajectory.control_dt_s,
                "slope": trajectory.slope_deg,
                "terminated": trajectory.terminated,
                "near": near_legs(trajectory),
                "box": [millimetres(half_length), millimetres(half_thickness)],
                "frames": frames,
            })
        })
        .collect();
    // `<` appears in strings only, where its escape means the same.
    Value::Array(gaits).to_string().replace('<', "\\u003c")
}

fn millimetres(metres: f64) -> i64 {
    /// What a number of JavaScript holds exactly; differences of two do not overflow.
    const LARGEST: f64 = (1_i64 << 53) as f64;
    (metres * 1e3).round().clamp(-LARGEST, LARGEST) as i64
}
