//! The legs' part of the graph: action law, prior, limits, kinematics. Each function is `gait`'s of the same name.

use canter_gait::action::MAX_AMPLITUDE_RAD;
use canter_gait::{
    Actuators, FiveBar, JointConvention, Leg, LegGait, LegGeometry, Modulation, Range, SerialLeg, Waveform,
};

use super::graph::{Builder, Value};
use super::is_direct;
use crate::exported::Exported;

/// The two targets of a leg.
pub fn targets(g: &mut Builder, exported: &Exported<'_>, index: usize, [phase, action]: [&Value; 2]) -> [Value; 2] {
    let controller = exported.controller();
    let leg = &controller.legs()[index];
    let position = if is_direct(exported) {
        let angles = [2 * index, 2 * index + 1].map(|i| g.columns(action, &[i]));
        leg_position(g, leg, angles)
    } else {
        gait_position(g, exported, index, [phase, action])
    };
    limited_targets(g, leg, position)
}

/// The two targets at which a leg already is, from all motor angles: `Leg::targets_at`.
pub fn targets_at(g: &mut Builder, leg: &Leg, index: usize, motor_angles: &Value) -> [Value; 2] {
    let angles = [2 * index, 2 * index + 1].map(|i| g.columns(motor_angles, &[i]));
    match leg.actuators {
        Actuators::LegSpace => leg_position(g, leg, angles),
        Actuators::Joints(joints) => joint_angles(g, joints, &angles),
    }
}

/// The phase after this step.
pub fn next_phase(g: &mut Builder, exported: &Exported<'_>, [phase, action]: [&Value; 2]) -> Value {
    let controller = exported.controller();
    let (law, default) = (controller.law(), controller.gait().stride_frequency_hz);
    let dt_s = exported.control_dt_s();
    let next = if law.modulation == Modulation::Modulate {
        let component = g.columns(action, &[0]);
        let factor = map(g, law.ranges.frequency_factor, 1.0, &component);
        let frequency = g.times(&factor, default);
        let frequency = blend(g, law.authority, default, &frequency);
        let step = g.times(&frequency, dt_s);
        g.add(phase, &step)
    } else {
        g.plus(phase, default * dt_s)
    };
    wrap(g, &next)
}

/// Cycles wrapped into [0, 1).
fn wrap(g: &mut Builder, cycles: &Value) -> Value {
    let whole = g.op("Floor", &[cycles], &[]);
    let wrapped = g.sub(cycles, &whole);
    let (is_inside, zero) = (g.is_below(&wrapped, 1.0), g.number(0.0));
    g.choose(&is_inside, &wrapped, &zero)
}

fn map(g: &mut Builder, range: Range, default: f32, action: &Value) -> Value {
    let is_negative = g.is_below(action, 0.0);
    let reach = g.choose_number(&is_negative, default - range.low, range.high - default);
    let change = g.mul(action, &reach);
    g.plus(&change, default)
}

fn blend(g: &mut Builder, authority: f32, default: f32, mapped: &Value) -> Value {
    let mapped = g.times(mapped, authority);
    g.plus(&mapped, (1.0 - authority) * default)
}

/// Where the policy wants a leg of the gait: swing and extension.
fn gait_position(g: &mut Builder, exported: &Exported<'_>, index: usize, [phase, action]: [&Value; 2]) -> [Value; 2] {
    let controller = exported.controller();
    let (law, leg, part) = (controller.law(), &controller.legs()[index], &controller.gait().legs[index]);
    let p = part.defaults;
    let amplitudes = [p.swing_amplitude, p.extension_amplitude];
    let offsets = [p.swing_offset, p.extension_offset];
    let shifted = g.plus(phase, part.phase_offset);
    let own_phase = wrap(g, &shifted);
    let wave = wave(g, leg, part, &own_phase);
    let start = match law.modulation {
        Modulation::Modulate => 1 + 4 * index,
        Modulation::LegAmplitude | Modulation::Residual => 2 * index,
        Modulation::Amplitude | Modulation::Direct => 0,
    };
    let ranges = law.ranges;
    let amplitude_ranges = [ranges.swing_amplitude, ranges.extension_amplitude];
    let offset_ranges = [ranges.swing_offset, ranges.extension_offset];
    let position = std::array::from_fn(|i| {
        let component = g.columns(action, &[start + i]);
        let (amplitude, offset) = if law.modulation == Modulation::Residual {
            (g.number(amplitudes[i]), g.number(offsets[i]))
        } else if law.modulation == Modulation::Modulate {
            let amplitude = map(g, amplitude_ranges[i], amplitudes[i], &component);
            let component = g.columns(action, &[start + 2 + i]);
            let change = map(g, offset_ranges[i], 0.0, &component);
            let offset = g.plus(&change, offsets[i]);
            (blend(g, law.authority, amplitudes[i], &amplitude), blend(g, law.authority, offsets[i], &offset))
        } else {
            let amplitude = blend(g, law.authority, amplitudes[i], &component);
            let limit = g.number(MAX_AMPLITUDE_RAD);
            (g.op("Min", &[&amplitude, &limit], &[]), g.number(offsets[i]))
        };
        let motion = g.mul(&amplitude, &wave[i]);
        g.add(&offset, &motion)
    });
    if law.modulation != Modulation::Residual {
        return position;
    }
    // Where the policy adds nothing at all this rounds where `gait` does not.
    let targets = limited_targets(g, leg, position);
    let moved = std::array::from_fn(|i| {
        let component = g.columns(action, &[start + i]);
        let change = g.times(&component, law.authority * law.residual_bound_rad);
        let moved = g.add(&targets[i], &change);
        match leg.actuators {
            Actuators::LegSpace => moved,
            Actuators::Joints(joints) => {
                let turned = g.plus(&moved, -joints[i].standing);
                g.times(&turned, joints[i].sign)
            }
        }
    });
    match leg.actuators {
        Actuators::LegSpace => moved,
        Actuators::Joints(_) => leg_position(g, leg, moved),
    }
}

/// The targets at a leg position, within the limits.
fn limited_targets(g: &mut Builder, leg: &Leg, [swing, extension]: [Value; 2]) -> [Value; 2] {
    let limited = [g.clip(&swing, leg.limits.swing), g.clip(&extension, leg.limits.extension)];
    let Actuators::Joints(joints) = leg.actuators else {
        return limited;
    };
    let angles = motor_angles(g, leg, limited);
    joint_angles(g, joints, &angles)
}

fn joint_angles(g: &mut Builder, joints: [JointConvention; 2], angles: &[Value; 2]) -> [Value; 2] {
    std::array::from_fn(|i| {
        let turned = g.times(&angles[i], joints[i].sign);
        g.plus(&turned, joints[i].standing)
    })
}

/// The motion's shape at a leg's phase.
fn wave(g: &mut Builder, leg: &Leg, part: &LegGait, phase: &Value) -> [Value; 2] {
    let sine = |g: &mut Builder, phase: &Value| {
        let angle = g.times(phase, std::f32::consts::TAU);
        g.op("Sin", &[&angle], &[])
    };
    match part.waveform {
        Waveform::Sine(own) => {
            let ahead = g.plus(phase, own.extension_phase);
            let ahead = wrap(g, &ahead);
            [sine(g, phase), sine(g, &ahead)]
        }
        Waveform::Stepping(own) => {
            let p = own.parameters();
            let in_flight = g.is_below(phase, p.flight_fraction);
            let flight = g.times(phase, 1.0 / p.flight_fraction);
            let stance = g.plus(phase, -p.flight_fraction);
            let stance = g.times(&stance, 1.0 / (1.0 - p.flight_fraction));
            let u = g.choose(&in_flight, &flight, &stance);
            let direction = g.choose_number(&in_flight, p.step_length_m, -p.step_length_m);
            let depth = g.choose_number(&in_flight, -p.up_amplitude_m, p.down_amplitude_m);
            let centred = g.plus(&u, -0.5);
            let forward = g.mul(&direction, &centred);
            let angle = g.times(&u, std::f32::consts::PI);
            let arc = g.op("Sin", &[&angle], &[]);
            let lift = g.mul(&depth, &arc);
            let down = g.plus(&lift, p.stance_height_m);
            let swing = g.atan2(&forward, &down);
            let length = g.hypot(&forward, &down);
            let extension = extension(g, leg, &length);
            let span = own.defaults();
            let scaled = |g: &mut Builder, value: &Value, centre: f32, half_range: f32| {
                let moved = g.plus(value, -centre);
                let half_range = g.number(half_range);
                g.div(&moved, &half_range)
            };
            [
                scaled(g, &swing, span.swing_offset, span.swing_amplitude),
                scaled(g, &extension, span.extension_offset, span.extension_amplitude),
            ]
        }
        Waveform::Table(table) => {
            let points = table.wave();
            let place = g.times(phase, points.len() as f32);
            let from = g.op("Floor", &[&place], &[]);
            let u = g.sub(&place, &from);
            let to = g.plus(&from, 1.0);
            [points.map(|point| point.swing), points.map(|point| point.extension)].map(|row| {
                let (from, to) = (g.look_up(&row, &from), g.look_up(&row, &to));
                let way = g.sub(&to, &from);
                let way = g.mul(&u, &way);
                g.add(&from, &way)
            })
        }
    }
}

/// Angle between two sides of a triangle, or that of the nearest triangle that there is.
fn triangle_angle(g: &mut Builder, side: f32, other_side: &Value, opposite: f32) -> Value {
    let square = g.mul(other_side, other_side);
    let numerator = g.plus(&square, side * side - opposite * opposite);
    let denominator = g.times(other_side, 2.0 * side);
    let cosine = g.div(&numerator, &denominator);
    let cosine = g.clip(&cosine, [-1.0, 1.0]);
    g.op("Acos", &[&cosine], &[])
}

/// The number minus the value.
fn from_number(g: &mut Builder, number: f32, value: &Value) -> Value {
    let number = g.number(number);
    g.sub(&number, value)
}

/// The extension at which a leg has this length.
fn extension(g: &mut Builder, leg: &Leg, length: &Value) -> Value {
    let (upper, lower, stance, half_separation) = match leg.geometry {
        LegGeometry::FiveBar(own) => {
            (own.upper_link_m(), own.lower_link_m(), own.stance_half_angle(), 0.5 * own.hip_separation_m())
        }
        LegGeometry::Serial(own) => (own.upper_link_m(), own.lower_link_m(), own.stance_half_angle(), 0.0),
    };
    let angle = if half_separation == 0.0 {
        triangle_angle(g, upper, length, lower)
    } else {
        let apart = g.number(half_separation);
        let from_hip = g.hypot(length, &apart);
        let between = triangle_angle(g, upper, &from_hip, lower);
        let inner = g.atan2(&apart, length);
        g.sub(&between, &inner)
    };
    from_number(g, stance, &angle)
}

/// Angles of a leg's motors at a leg position.
fn motor_angles(g: &mut Builder, leg: &Leg, [swing, extension]: [Value; 2]) -> [Value; 2] {
    match leg.geometry {
        LegGeometry::FiveBar(own) if own.hip_separation_m() == 0.0 => {
            [g.sub(&swing, &extension), g.add(&swing, &extension)]
        }
        LegGeometry::FiveBar(own) => {
            let length = five_bar_length(g, &own, &extension);
            let (sine, cosine) = (g.op("Sin", &[&swing], &[]), g.op("Cos", &[&swing], &[]));
            let (forward, down) = (g.mul(&length, &sine), g.mul(&length, &cosine));
            [1.0, -1.0].map(|side: f32| {
                let ahead = g.plus(&forward, -side * 0.5 * own.hip_separation_m());
                let from_hip = g.hypot(&ahead, &down);
                let delta = triangle_angle(g, own.upper_link_m(), &from_hip, own.lower_link_m());
                let delta = g.plus(&delta, -own.stance_half_angle());
                let delta = g.times(&delta, side);
                let alpha = g.atan2(&ahead, &down);
                g.add(&alpha, &delta)
            })
        }
        LegGeometry::Serial(own) => {
            let side = knee_side(&own);
            let gamma = from_number(g, own.stance_half_angle(), &extension);
            let fold = fold(g, &own, &gamma);
            let knee = from_number(g, standing_fold(&own), &fold);
            let shift = g.times(&extension, side);
            [g.sub(&swing, &shift), g.times(&knee, side)]
        }
    }
}

/// The leg position at a leg's motor angles.
fn leg_position(g: &mut Builder, leg: &Leg, [first, second]: [Value; 2]) -> [Value; 2] {
    match leg.geometry {
        LegGeometry::FiveBar(own) if own.hip_separation_m() == 0.0 => {
            let (sum, difference) = (g.add(&first, &second), g.sub(&second, &first));
            [g.times(&sum, 0.5), g.times(&difference, 0.5)]
        }
        LegGeometry::FiveBar(own) => {
            let half_separation = 0.5 * own.hip_separation_m();
            let mut knee = |side: f32, angle: &Value| {
                let angle = g.plus(angle, side * own.stance_half_angle());
                let (sine, cosine) = (g.op("Sin", &[&angle], &[]), g.op("Cos", &[&angle], &[]));
                let forward = g.times(&sine, own.upper_link_m());
                [g.plus(&forward, side * half_separation), g.times(&cosine, own.upper_link_m())]
            };
            let (front, back) = (knee(1.0, &first), knee(-1.0, &second));
            let [forward, down] = std::array::from_fn(|i| g.sub(&front[i], &back[i]));
            let apart = g.hypot(&forward, &down);
            let least = g.number(f32::MIN_POSITIVE);
            let half = g.times(&apart, 0.5);
            let half = g.op("Max", &[&half, &least], &[]);
            let square = g.mul(&half, &half);
            let square = from_number(g, own.lower_link_m() * own.lower_link_m(), &square);
            let across = root(g, &square);
            let double = g.times(&half, 2.0);
            let across = g.div(&across, &double);
            let [middle_forward, middle_down] = std::array::from_fn(|i| {
                let sum = g.add(&front[i], &back[i]);
                g.times(&sum, 0.5)
            });
            let (along_down, along_forward) = (g.mul(&across, &down), g.mul(&across, &forward));
            let (forward, down) = (g.sub(&middle_forward, &along_down), g.add(&middle_down, &along_forward));
            let length = g.hypot(&forward, &down);
            [g.atan2(&forward, &down), extension(g, leg, &length)]
        }
        LegGeometry::Serial(own) => {
            let (upper, lower, side) = (own.upper_link_m(), own.lower_link_m(), knee_side(&own));
            let knee = g.times(&second, side);
            let fold = from_number(g, standing_fold(&own), &knee);
            let cosine = g.op("Cos", &[&fold], &[]);
            let squares = g.times(&cosine, 2.0 * upper * lower);
            let squares = g.plus(&squares, upper * upper + lower * lower);
            let least = g.number(f32::MIN_POSITIVE);
            let length = root(g, &squares);
            let length = g.op("Max", &[&length, &least], &[]);
            let angle = triangle_angle(g, upper, &length, lower);
            let extension = from_number(g, own.stance_half_angle(), &angle);
            let shift = g.times(&extension, side);
            [g.add(&first, &shift), extension]
        }
    }
}

/// Square root, 0 of what is negative.
fn root(g: &mut Builder, square: &Value) -> Value {
    let positive = g.op("Relu", &[square], &[]);
    g.op("Sqrt", &[&positive], &[])
}

fn five_bar_length(g: &mut Builder, leg: &FiveBar, extension: &Value) -> Value {
    let gamma = from_number(g, leg.stance_half_angle(), extension);
    let (sine, cosine) = (g.op("Sin", &[&gamma], &[]), g.op("Cos", &[&gamma], &[]));
    let across = g.times(&sine, leg.upper_link_m());
    let across = g.plus(&across, 0.5 * leg.hip_separation_m());
    let square = g.mul(&across, &across);
    let square = from_number(g, leg.lower_link_m() * leg.lower_link_m(), &square);
    let (below_knee, above_knee) = (root(g, &square), g.times(&cosine, leg.upper_link_m()));
    g.add(&above_knee, &below_knee)
}

fn knee_side(leg: &SerialLeg) -> f32 {
    if leg.knee_in_front() { 1.0 } else { -1.0 }
}

/// Angle at the knee by which the lower link departs from the upper link's direction.
fn fold(g: &mut Builder, leg: &SerialLeg, gamma: &Value) -> Value {
    let sine = g.op("Sin", &[gamma], &[]);
    let sine = g.times(&sine, leg.upper_link_m() / leg.lower_link_m());
    let sine = g.clip(&sine, [-1.0, 1.0]);
    let angle = g.op("Asin", &[&sine], &[]);
    g.add(gamma, &angle)
}

/// The same in the standing pose.
fn standing_fold(leg: &SerialLeg) -> f32 {
    let gamma = leg.stance_half_angle();
    gamma + (leg.upper_link_m() * gamma.sin() / leg.lower_link_m()).clamp(-1.0, 1.0).asin()
}
