//! Reports that a person looks at: one self-contained HTML page with SVG figures.
//!
//! What it is: the verdict, the figures that convince, and the parameters, in a page without network; its only script copies tables.
//! What can go wrong: nothing; missing channels leave their figures out.
//! Units: on the axes.
//! Reference: specification `identification.md`, item 5.

pub mod almanac;
mod beam;
mod beside_runs;
pub(crate) mod closed;
mod designer;
mod figure;
pub mod flight;
pub mod flight_almanac;
mod history;
pub mod inertial;
mod isolability;
pub mod joined;
mod page;
mod run;
mod selection;
mod several;
mod sheet;
mod shift;
mod style;
mod svg;

pub use beam::{beam, figures as beam_figures, warning as beam_warning};
#[cfg(test)]
pub(crate) use closed::bare_entry;
pub use closed::{Hidden, Origin, Vocabulary, WIDEST, sentence, terminal, wrapped};
pub use figure::{Figure, Layer, Mark};
pub use history::{page as history_page, terminal as history_terminal};
pub use isolability::{isolability, isolability_csv, isolability_svg};
pub use page::closed_loop;
pub use run::{headline, run, when};
pub use selection::{selection, tenths};
pub use several::several;
pub use sheet::{Sheet, write_figures};
pub use shift::{filter_figures, study_figures};
