//! Figures from recorded episodes: film strips, footfall, foot paths, speed per step, torque, leg space.

use crate::chart::{Axis, Chart, PANEL, Panel, quantity, shortened};
use crate::figures::{Figure, Flow, Group, Subject, rows};
use crate::motion::{
    body_corners, duty_factor, in_body, middle_stride, near_legs, settled, side_view, speed_per_step, strides,
    way_along_heading,
};
use crate::read::Trajectory;
use crate::statistics::{mean, moving_average, population_std, quantile};
use crate::svg::{Anchor, Drawing};

/// A gait with its recorded episode.
pub type Recorded<'a> = (&'a Subject, &'a Trajectory);

/// Frames of a film strip.
const NUM_FRAMES: usize = 8;

/// Width of a frame.
const FRAME_WIDTH: f64 = 92.0;

/// Half the width of a frame from which on its ground has no ticks [m].
const LARGEST_HALF_WIDTH_M: f64 = 20.0;

/// Time that a footfall diagram shows [s].
const FOOTFALL_S: f64 = 1.2;

/// Strides whose foot paths are drawn.
const NUM_PATH_STRIDES: usize = 4;

/// What the captions of recorded gaits have in common.
fn which_episode(recorded: &[Recorded<'_>]) -> String {
    let slope = recorded[0].1.slope_deg;
    let ground = if slope == 0.0 { "level ground".to_owned() } else { format!("a slope of {slope} degrees") };
    format!("One recorded episode of each gait, from the same start, on {ground}.")
}

/// Side views over one stride.
pub fn film_strip(recorded: &[Recorded<'_>]) -> Figure {
    // One scale for all, from the outermost point of any gait.
    let mut reach: (f64, f64) = (0.0, 0.0);
    for (_, trajectory) in recorded {
        let (from, to) = middle_stride(trajectory);
        for step in from..to {
            let feet = trajectory.foot_m[step].iter().chain(trajectory.knee_m[step].iter().flatten());
            let corners = body_corners(trajectory, step);
            for (across, up) in feet.map(|&point| side_view(trajectory, step, point)).chain(corners) {
                reach = (reach.0.max(across.abs()), reach.1.max(up));
            }
        }
    }
    let scale = 0.5 * FRAME_WIDTH / (reach.0 * 1.06).max(1e-3);
    let height = reach.1 * scale + 20.0;
    let groups = recorded
        .iter()
        .map(|(subject, trajectory)| {
            let (from, to) = middle_stride(trajectory);
            let panels = (0..NUM_FRAMES)
                .map(|frame| {
                    let step = from + (to - from) * frame / NUM_FRAMES;
                    let time = trajectory.time_s[step] - trajectory.time_s[from];
                    frame_panel(subject, trajectory, step, time, scale, height)
                })
                .collect();
            let length = trajectory.position_m[to][0] - trajectory.position_m[from][0];
            let duration = trajectory.time_s[to] - trajectory.time_s[from];
            let heading = format!(
                "{}: one stride, {} mm forward in {} s",
                subject.label,
                quantity(length * 1e3, 0),
                quantity(duration, 2)
            );
            Group { heading: Some((heading, Some(subject.tone))), flow: Flow::Strip, columns: NUM_FRAMES, panels }
        })
        .collect();
    Figure {
        name: "film-strip",
        title: "One stride of each gait".to_owned(),
        caption: format!(
            "Seen from the robot's right, at {NUM_FRAMES} equally spaced times of the stride in the middle of the \
             episode; all at one scale. Strong lines: the near legs; faint lines: the far ones. A filled foot touches \
             the ground; ticks on the ground are 0.1 m apart. {} Paper: figure 4.",
            which_episode(recorded)
        ),
        groups,
    }
}

fn frame_panel(subject: &Subject, trajectory: &Trajectory, step: usize, time: f64, scale: f64, height: f64) -> Panel {
    let mut drawing = Drawing::default();
    let ground = height - 14.0;
    let at = |x: f64, z: f64| (0.5 * FRAME_WIDTH + x * scale, ground - z * scale);
    let point = |point: [f64; 3]| {
        let (forward, up) = side_view(trajectory, step, point);
        at(forward, up)
    };
    let way = way_along_heading(trajectory)[step];
    drawing.line("ground", (0.0, ground), (FRAME_WIDTH, ground));
    let half_width_m = 0.5 * FRAME_WIDTH / scale;
    let (first, last) = ((way - half_width_m) / 0.1, (way + half_width_m) / 0.1);
    // On a frame that shows more of the ground than a robot could need, ticks would cover everything.
    let is_drawn = half_width_m < LARGEST_HALF_WIDTH_M;
    for tick in (first.ceil() as i64..=last.floor() as i64).take_while(|_| is_drawn) {
        let (x, _) = at(tick as f64 * 0.1 - way, 0.0);
        drawing.line("ground", (x, ground), (x, ground + 3.0));
    }
    let near = near_legs(trajectory);
    let stroke = subject.tone.stroke();
    let legs = |drawing: &mut Drawing, is_near: bool| {
        for leg in (0..near.len()).filter(|&leg| near[leg] == is_near) {
            let (hip, foot) = (trajectory.hip_m[step][leg], trajectory.foot_m[step][leg]);
            let class = format!("{} {stroke}", if is_near { "limb" } else { "far" });
            for knee in trajectory.knee_m[step][leg] {
                drawing.polyline(&class, &[point(hip), point(knee), point(foot)]);
            }
            if trajectory.contact[step][leg] != 0 {
                drawing.dot(&subject.tone.fill(), point(foot), 2.6, None);
            }
        }
    };
    legs(&mut drawing, false);
    let corners = body_corners(trajectory, step).map(|(x, z)| at(x, z));
    drawing.polygon(&format!("box {stroke} {}", subject.tone.fill()), &corners);
    legs(&mut drawing, true);
    drawing.text("mut sml", (0.5 * FRAME_WIDTH, height - 1.0), Anchor::Middle, &format!("{time:.2} s"));
    Panel {
        body: drawing.into_body(),
        size: (FRAME_WIDTH, height),
        alt: format!("{} in side view at {time:.2} s", subject.label),
    }
}

/// Which foot touches the ground when.
pub fn footfall(recorded: &[Recorded<'_>]) -> Figure {
    let panels = recorded
        .iter()
        .map(|(subject, trajectory)| {
            let from = middle_stride(trajectory).0;
            let start = trajectory.time_s[from];
            let to = trajectory.time_s.partition_point(|&time| time < start + FOOTFALL_S);
            let body_touches = trajectory.body_contact.iter().any(|&count| count > 0);
            let rows = trajectory.legs.len() + usize::from(body_touches);
            let (left, right, top, spacing) = (72.0, 316.0, 26.0, 19.0);
            let bottom = top + rows as f64 * spacing;
            let x_at = |time: f64| left + (time - start) / FOOTFALL_S * (right - left);
            let mut drawing = Drawing::default();
            drawing.text(&format!("ttl {}", subject.tone.text()), (0.0, 13.0), Anchor::Start, &subject.label);
            drawing.text("mut sml", (360.0, 13.0), Anchor::End, "stance");
            for (begin, _) in strides(trajectory).into_iter().filter(|(begin, _)| (from..to).contains(begin)) {
                let x = x_at(trajectory.time_s[begin]);
                drawing.line("grid", (x, top - 2.0), (x, bottom + 2.0));
            }
            let bars = |drawing: &mut Drawing, y: f64, class: &str, touches: &dyn Fn(usize) -> bool| {
                let mut step = from;
                while step < to {
                    let first = step;
                    while step < to && touches(step) {
                        step += 1;
                    }
                    if step > first {
                        let x = x_at(trajectory.time_s[first]);
                        let width = (step - first) as f64 * trajectory.control_dt_s / FOOTFALL_S * (right - left);
                        drawing.rectangle(class, (x, y - 5.0), (width.min(right - x), 10.0), 2.0);
                    }
                    step += 1;
                }
            };
            for (leg, name) in trajectory.legs.iter().enumerate() {
                let y = top + (leg as f64 + 0.5) * spacing;
                drawing.text("mut", (0.0, y + 3.8), Anchor::Start, &shortened(&name.replace('_', " "), 6.2));
                drawing.line("grid", (left, y), (right, y));
                bars(&mut drawing, y, &subject.tone.fill(), &|step| trajectory.contact[step][leg] != 0);
                let share = format!("{:.0} %", 100.0 * duty_factor(trajectory, leg));
                drawing.text("ink", (360.0, y + 3.8), Anchor::End, &share);
            }
            if body_touches {
                let y = top + (rows as f64 - 0.5) * spacing;
                drawing.text("alarm", (0.0, y + 3.8), Anchor::Start, "body, links");
                bars(&mut drawing, y, "alarm", &|step| trajectory.body_contact[step] > 0);
            }
            drawing.line("axis", (left, bottom + 2.0), (right, bottom + 2.0));
            for tick in 0..=6 {
                let time = f64::from(tick) * 0.2;
                let x = x_at(start + time);
                drawing.line("axis", (x, bottom + 2.0), (x, bottom + 6.0));
                let unit = if tick == 6 { " s" } else { "" };
                let text = format!("{time:.1}{unit}");
                drawing.text("mut sml", (x, bottom + 17.0), Anchor::Middle, &text);
            }
            let alt = format!("footfall of {}", subject.label);
            Panel { body: drawing.into_body(), size: (360.0, bottom + 22.0), alt }
        })
        .collect();
    Figure {
        name: "footfall",
        title: "Which foot is on the ground".to_owned(),
        caption: format!(
            "Hildebrand diagrams: a bar while the foot touches the ground; upright lines: a stride begins; right: duty \
             factor, the share of the episode after settling in stance. A row for body and links appears only where \
             anything but a foot touches the ground in the episode. {} Paper: figure 4.",
            which_episode(recorded)
        ),
        groups: vec![Group::pairs(panels)],
    }
}

/// The feet's ways in the body's frame.
pub fn foot_paths(recorded: &[Recorded<'_>]) -> Figure {
    let paths: Vec<_> = recorded
        .iter()
        .map(|(_, trajectory)| {
            let strides = strides(trajectory);
            let first = (strides.len() / 2).saturating_sub(NUM_PATH_STRIDES / 2);
            let last = (first + NUM_PATH_STRIDES).min(strides.len()) - 1;
            (0..trajectory.legs.len())
                .map(|leg| {
                    (strides[first].0..=strides[last].1)
                        .map(|step| in_body(trajectory, step, trajectory.foot_m[step][leg]))
                        .map(|[x, _, z]| [x * 1e3, z * 1e3])
                        .collect::<Vec<_>>()
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let all = || paths.iter().flatten().flatten();
    let x = Axis::over("forward of the body's centre [mm]", all().map(|point| point[0]));
    let y = Axis::over("above the body's centre [mm]", all().map(|point| point[1]));
    let panels = recorded
        .iter()
        .zip(&paths)
        .map(|((subject, trajectory), paths)| {
            let mut chart = Chart::new(&subject.label, (PANEL.0, 190.0), &x, &y, &[]);
            for (path, is_near) in paths.iter().zip(near_legs(trajectory)) {
                let class = format!("{} {}", if is_near { "line" } else { "far" }, subject.tone.stroke());
                chart.line(&class, path.iter().copied());
            }
            chart.finish()
        })
        .collect();
    Figure {
        name: "foot-paths",
        title: "The feet's paths in the body's frame".to_owned(),
        caption: format!(
            "Seen from the robot's right, {NUM_PATH_STRIDES} strides from the middle of the episode; strong lines: \
             right legs, faint lines: left legs. Up is stretched or squeezed to fit; the scales are the same for all \
             gaits. {}",
            which_episode(recorded)
        ),
        groups: vec![Group::pairs(panels)],
    }
}

/// The forward way of each control step.
pub fn speed_steps(recorded: &[Recorded<'_>]) -> Figure {
    let speeds: Vec<_> = recorded
        .iter()
        .map(|(_, trajectory)| speed_per_step(trajectory).iter().map(|way| way * 1e3).collect::<Vec<f64>>())
        .collect();
    let longest = speeds.iter().map(Vec::len).max().unwrap_or(1);
    let x = Axis::exactly("control step", (0.0, longest as f64));
    let y = Axis::from_zero("mm a step (right: m/s)", speeds.iter().flatten().copied());
    let panels = recorded
        .iter()
        .zip(&speeds)
        .map(|((subject, trajectory), speeds)| {
            let counted = &speeds[settled(trajectory).min(speeds.len() - 1)..];
            let title = format!(
                "{}: {} m/s, {} \u{00b1} {} mm a step",
                subject.label,
                quantity(mean(counted) * 1e-3 / trajectory.control_dt_s, 2),
                quantity(mean(counted), 1),
                quantity(population_std(counted), 1),
            );
            let mut chart = Chart::new(&title, (PANEL.0, 190.0), &x, &y, &["0.00"]);
            let points = |values: &[f64]| {
                values.iter().enumerate().map(|(i, &value)| [(i + 1) as f64, value]).collect::<Vec<_>>()
            };
            let (from, to) = middle_stride(trajectory);
            chart.line(&format!("faint {}", subject.tone.stroke()), points(speeds));
            chart.line(&format!("line {}", subject.tone.stroke()), points(&moving_average(speeds, to - from)));
            let (_, right, _, _) = chart.field();
            let per_step = 1e-3 / trajectory.control_dt_s;
            let metres = Axis::exactly("", (y.range.0 * per_step, y.range.1 * per_step));
            for (value, text) in crate::chart::round_ticks(metres.range, 8.0) {
                let at = chart.y_at(value / per_step);
                chart.drawing().text("mut", (right + 6.0, at + 3.8), Anchor::Start, &text);
            }
            chart.finish()
        })
        .collect();
    Figure {
        name: "speed-per-step",
        title: "Speed at every control step".to_owned(),
        caption: format!(
            "The body's forward way in each control step (eq. 7 of the paper): faint, as recorded; strong, its mean \
             over one stride. Mean \u{00b1} standard deviation after settling in the titles. {} Paper: figure 6.",
            which_episode(recorded)
        ),
        groups: vec![Group::pairs(panels)],
    }
}

/// How much of the torque limit is used how often.
pub fn torque(recorded: &[Recorded<'_>]) -> Figure {
    let labels: Vec<&str> = recorded.iter().map(|(subject, _)| subject.label.as_str()).collect();
    let x = Axis::exactly("share of the time [%]", (0.0, 100.0));
    let y = Axis::exactly("torque not exceeded [% of the limit]", (0.0, 100.0));
    let mut chart = Chart::new("", (rows::WIDTH, 260.0), &x, &y, &labels);
    for (subject, trajectory) in recorded {
        let mut used: Vec<f64> = trajectory.torque_nm[settled(trajectory)..]
            .iter()
            .flatten()
            .map(|torque| torque.abs() / trajectory.max_torque_nm)
            .collect();
        used.sort_by(f64::total_cmp);
        let points: Vec<_> =
            (0..=100).map(f64::from).map(|percent| [percent, 100.0 * quantile(&used, percent / 100.0)]).collect();
        chart.line(&format!("line {}", subject.tone.dashed()), points.iter().copied());
        chart.label(points[100][1], subject.tone, &subject.label);
    }
    Figure {
        name: "torque",
        title: "How hard the motors work".to_owned(),
        caption: format!(
            "Torque that is not exceeded in a share of the time, over all motors and steps after settling, without its \
             sign, against the limit of {} N m; at the right end: the greatest torque. {}",
            recorded[0].1.max_torque_nm,
            which_episode(recorded)
        ),
        groups: vec![rows::alone(chart.finish())],
    }
}

/// Commanded and reached leg positions within their limits.
pub fn leg_space(recorded: &[Recorded<'_>]) -> Figure {
    let limits = || recorded.iter().map(|(_, trajectory)| trajectory);
    let x = Axis::over("swing [rad]", limits().flat_map(|trajectory| trajectory.swing_limits_rad));
    let y = Axis::over("extension [rad]", limits().flat_map(|trajectory| trajectory.extension_limits_rad));
    let panels = recorded
        .iter()
        .map(|(subject, trajectory)| {
            let mut chart = Chart::new(&subject.label, (PANEL.0, 210.0), &x, &y, &[]);
            let (swing, extension) = (trajectory.swing_limits_rad, trajectory.extension_limits_rad);
            let corner = chart.at([swing[0], extension[1]]);
            let opposite = chart.at([swing[1], extension[0]]);
            let outline = [corner, (opposite.0, corner.1), opposite, (corner.0, opposite.1), corner];
            chart.drawing().polyline("rule", &outline);
            let from = settled(trajectory);
            let to = (from + (2.0 / trajectory.control_dt_s) as usize).min(trajectory.time_s.len());
            for leg in 0..trajectory.legs.len() {
                let way = |swing: &[Vec<f64>], extension: &[Vec<f64>]| {
                    (from..to).map(|step| [swing[step][leg], extension[step][leg]]).collect::<Vec<_>>()
                };
                chart.line("faint axis", way(&trajectory.commanded_swing_rad, &trajectory.commanded_extension_rad));
                let reached = way(&trajectory.swing_rad, &trajectory.extension_rad);
                chart.line(&format!("thin {}", subject.tone.stroke()), reached);
            }
            chart.finish()
        })
        .collect();
    Figure {
        name: "leg-space",
        title: "Leg space in use".to_owned(),
        caption: format!(
            "Swing and extension of all legs over two seconds after settling: grey, as commanded; coloured, as reached; \
             dashed, the limits. {}",
            which_episode(recorded)
        ),
        groups: vec![Group::pairs(panels)],
    }
}
