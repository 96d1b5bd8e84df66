//! The macros that declare settings. Doc comments become the comments and the help of the file.

/// Declares a struct that is a TOML table: each field is a key, in this order.
///
/// A number, or an `Option` or `Vec` of numbers, may have a range after `in`; see also
/// [`above`](crate::settings::above). A field without `Option` must be in the file. A table may be missing if each of
/// its fields may.
///
/// ```
/// # use canter_sim::settings;
/// settings! {
///     /// Proximal policy optimisation.
///     pub struct PpoSettings {
///         /// Discount factor per env step.
///         pub gamma: f64 in 0.0..=1.0,
///         /// Clip range of eq. 3.
///         pub clip_epsilon: Option<f64> in 0.0..=1.0,
///         /// Name of the run.
///         pub label: String,
///     }
/// }
/// ```
#[macro_export]
macro_rules! settings {
    (
        $(#[doc = $struct_doc:expr])*
        $vis:vis struct $Struct:ident {
            $(
                $(#[doc = $doc:expr])*
                // The type is taken apart because `in` may not follow a whole one.
                pub $field:ident : $Type:ident $(< $Inner:ty >)? $(in $range:expr)?
            ),* $(,)?
        }
    ) => {
        $(#[doc = $struct_doc])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $Struct {
            $( $(#[doc = $doc])* pub $field: $Type $(< $Inner >)?, )*
        }

        impl $crate::settings::Setting for $Struct {
            type Limit = ();

            fn read(
                node: &$crate::settings::Node<'_>,
                _: &$crate::settings::Limits<()>,
                problems: &mut $crate::settings::Problems,
            ) -> Option<Self> {
                node.check_keys(&[$( stringify!($field) ),*], problems)?;
                // All fields are read before the first `?`, so that all problems are reported.
                $(
                    let limits = $crate::settings::Limits::none() $( .within($range) )?;
                    let $field = node.field::<$Type $(< $Inner >)?>(stringify!($field), &limits, problems);
                )*
                Some(Self { $( $field: $field?, )* })
            }

            fn write(&self) -> $crate::settings::Output {
                $crate::settings::Output::table(vec![
                    $( (stringify!($field), $crate::settings::Setting::write(&self.$field)) ),*
                ])
            }

            fn shape(_: &$crate::settings::Limits<()>) -> $crate::settings::Shape {
                $crate::settings::Shape::table(vec![
                    $(
                        $crate::settings::Field::new::<$Type $(< $Inner >)?>(
                            stringify!($field),
                            concat!($( $doc, "\n" ),*),
                            &$crate::settings::Limits::none() $( .within($range) )?,
                        )
                    ),*
                ])
            }

            fn absent() -> Option<Self> {
                Some(Self { $( $field: <$Type $(< $Inner >)? as $crate::settings::Setting>::absent()?, )* })
            }
        }
    };
}

/// Declares an enum that is a string in TOML, one of a closed list.
///
/// ```
/// # use canter_sim::choices;
/// choices! {
///     /// Which legs move together.
///     pub enum Footfall {
///         /// Diagonal pairs.
///         Trot = "trot",
///         /// Front and rear pairs.
///         Bound = "bound",
///     }
/// }
/// assert_eq!(Footfall::Bound.name(), "bound");
/// ```
#[macro_export]
macro_rules! choices {
    (
        $(#[doc = $enum_doc:expr])*
        $vis:vis enum $Enum:ident {
            $( $(#[doc = $doc:expr])* $Variant:ident = $name:literal ),+ $(,)?
        }
    ) => {
        $(#[doc = $enum_doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        $vis enum $Enum {
            $( $(#[doc = $doc])* $Variant, )+
        }

        impl $Enum {
            /// Every choice, in declared order.
            pub const ALL: &[Self] = &[$( Self::$Variant ),+];

            /// The string that stands for this choice in TOML.
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$Variant => $name, )+
                }
            }
        }

        impl $crate::settings::Setting for $Enum {
            type Limit = ();

            fn read(
                node: &$crate::settings::Node<'_>,
                limits: &$crate::settings::Limits<()>,
                problems: &mut $crate::settings::Problems,
            ) -> Option<Self> {
                let choices = Self::shape(limits).choices;
                let name = node.choice(&choices, problems)?;
                Self::ALL.iter().copied().find(|choice| choice.name() == name)
            }

            fn write(&self) -> $crate::settings::Output {
                $crate::settings::Setting::write(&self.name().to_owned())
            }

            fn shape(_: &$crate::settings::Limits<()>) -> $crate::settings::Shape {
                $crate::settings::Shape::choice(vec![
                    $( $crate::settings::Choice::new($name, concat!($( $doc, "\n" ),*)) ),+
                ])
            }
        }
    };
}

/// Declares an enum that is a table in TOML, whose key `kind` selects the variant; the other keys are the settings of
/// the struct in the variant, which has no `kind` of its own.
///
/// ```
/// # use canter_sim::{settings, tagged};
/// settings! {
///     /// A sine.
///     pub struct SineSettings {
///         /// Amplitude of the swing [rad].
///         pub swing_amplitude_rad: f64 in 0.0..=1.0,
///     }
/// }
/// tagged! {
///     /// The gait without the policy.
///     pub enum PriorSettings {
///         /// Equation 4.
///         Sine(SineSettings) = "sine",
///     }
/// }
/// ```
#[macro_export]
macro_rules! tagged {
    (
        $(#[doc = $enum_doc:expr])*
        $vis:vis enum $Enum:ident {
            $( $(#[doc = $doc:expr])* $Variant:ident($Settings:ty) = $name:literal ),+ $(,)?
        }
    ) => {
        $(#[doc = $enum_doc])*
        #[derive(Debug, Clone, PartialEq)]
        $vis enum $Enum {
            $( $(#[doc = $doc])* $Variant($Settings), )+
        }

        impl $crate::settings::Setting for $Enum {
            type Limit = ();

            fn read(
                node: &$crate::settings::Node<'_>,
                limits: &$crate::settings::Limits<()>,
                problems: &mut $crate::settings::Problems,
            ) -> Option<Self> {
                let choices = Self::shape(limits).choices;
                let (kind, table) = node.tag(&choices, problems)?;
                match kind {
                    $( $name => <$Settings>::read(&table, limits, problems).map(Self::$Variant), )+
                    _ => None,
                }
            }

            fn write(&self) -> $crate::settings::Output {
                match self {
                    $( Self::$Variant(settings) => settings.write().with_kind($name), )+
                }
            }

            fn shape(limits: &$crate::settings::Limits<()>) -> $crate::settings::Shape {
                $crate::settings::Shape::tagged_table(vec![
                    $(
                        $crate::settings::Choice::with_fields(
                            $name,
                            concat!($( $doc, "\n" ),*),
                            <$Settings>::shape(limits).fields,
                        )
                    ),+
                ])
            }
        }
    };
}
