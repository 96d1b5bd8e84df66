//! Left and right exchanged: a policy that treats both sides alike.
//!
//! A trot's second half is its first half in a mirror. A policy with a mirror sees every state of the second half as the
//! one of the first half that mirrors it, and its action is mirrored back: it has no favourite side, and whatever it
//! learns on one side it knows on the other.

/// Where a component of a mirror image comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Which component of the original.
    pub source: usize,
    /// 1, or -1 for what changes its sign in a mirror.
    pub sign: f32,
}

/// What becomes of observations and actions in the mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror<'a> {
    observation: &'a [Component],
    action: &'a [Component],
    /// Which component of the observation is the sine of the phase.
    sine: usize,
}

impl<'a> Mirror<'a> {
    /// A mirror; none unless the mirror image of each image is the original, and the sine lies in the observation.
    ///
    /// # Shapes
    /// - `observation`: `(O)`
    /// - `action`: `(A)`
    /// - `sine`: which component of the observation is the sine of the phase
    pub fn new(observation: &'a [Component], action: &'a [Component], sine: usize) -> Option<Self> {
        let is_mirror = is_involution(observation) && is_involution(action) && sine < observation.len();
        is_mirror.then_some(Self { observation, action, sine })
    }

    /// A mirror that [`new`](Self::new) has accepted before; of anything else the images are odd, and nothing worse.
    #[inline]
    pub const fn from_checked(observation: &'a [Component], action: &'a [Component], sine: usize) -> Self {
        Self { observation, action, sine }
    }

    /// Whether an observation belongs to the second half of the gait's cycle, which is seen in the mirror.
    #[inline]
    pub fn reflects(&self, observation: &[f32]) -> bool {
        observation.get(self.sine).is_some_and(|&sine| sine < 0.0)
    }

    /// Replaces an observation, `(O)`, not normalised, by its mirror image.
    #[inline]
    pub fn reflect_observation(&self, observation: &mut [f32]) {
        reflect(self.observation, observation);
    }

    /// Replaces an action, `(A)`, by its mirror image.
    #[inline]
    pub fn reflect_action(&self, action: &mut [f32]) {
        reflect(self.action, action);
    }
}

/// Whether every component's source has the component as its own, with the same sign.
fn is_involution(components: &[Component]) -> bool {
    components.iter().enumerate().all(|(i, component)| {
        let back = components.get(component.source);
        component.sign.abs() == 1.0 && back.is_some_and(|back| back.source == i && back.sign == component.sign)
    })
}

/// Exchanges components in place; what has no partner within the vector stays.
fn reflect(components: &[Component], vector: &mut [f32]) {
    let len = vector.len();
    for (i, component) in components.iter().enumerate().take(len) {
        let j = component.source;
        if j >= i && j < len {
            vector.swap(i, j);
            vector[i] *= component.sign;
            if j != i {
                vector[j] *= component.sign;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn component(source: usize, sign: f32) -> Component {
        Component { source, sign }
    }

    const OBSERVATION: [Component; 5] =
        [component(1, 1.0), component(0, 1.0), component(2, -1.0), component(4, -1.0), component(3, -1.0)];
    const ACTION: [Component; 2] = [component(1, 1.0), component(0, 1.0)];

    #[test]
    fn the_image_by_hand_and_twice_in_the_mirror_is_as_before() {
        let mirror = Mirror::new(&OBSERVATION, &ACTION, 2).unwrap();
        let mut observation = [1.0, 2.0, 3.0, 4.0, 5.0];
        mirror.reflect_observation(&mut observation);
        assert_eq!(observation, [2.0, 1.0, -3.0, -5.0, -4.0]);
        mirror.reflect_observation(&mut observation);
        assert_eq!(observation, [1.0, 2.0, 3.0, 4.0, 5.0]);
        let mut action = [0.25, -0.5];
        mirror.reflect_action(&mut action);
        assert_eq!(action, [-0.5, 0.25]);
    }

    #[test]
    fn the_second_half_of_the_cycle_is_reflected() {
        let mirror = Mirror::new(&OBSERVATION, &ACTION, 2).unwrap();
        let reflects = |sine: f32| mirror.reflects(&[0.0, 0.0, sine, 0.0, 0.0]);
        assert!(!reflects(0.0) && !reflects(0.7) && !reflects(f32::NAN) && reflects(-0.7));
        assert!(!mirror.reflects(&[]));
    }

    #[test]
    fn what_is_no_mirror_is_refused() {
        assert!(Mirror::new(&OBSERVATION, &ACTION, 5).is_none());
        assert!(Mirror::new(&[component(1, 1.0), component(1, 1.0)], &ACTION, 0).is_none());
        assert!(Mirror::new(&[component(0, 0.5)], &ACTION, 0).is_none());
        assert!(Mirror::new(&[component(7, 1.0)], &ACTION, 0).is_none());
        assert!(Mirror::new(&[component(1, 1.0), component(0, -1.0)], &ACTION, 0).is_none());
    }

    #[test]
    fn short_slices_do_not_panic() {
        let mirror = Mirror::new(&OBSERVATION, &ACTION, 2).unwrap();
        let mut short = [1.0];
        mirror.reflect_observation(&mut short);
        assert_eq!(short, [1.0]);
    }
}
