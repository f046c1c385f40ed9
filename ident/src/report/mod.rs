//! Reports that a person looks at: one self-contained HTML page with SVG figures.
//!
//! What it is: the verdict, the figures that convince, and the parameters, in a page without network or script.
//! What can go wrong: nothing; missing channels leave their figures out.
//! Units: on the axes.
//! Reference: specification `identification.md`, item 5.

mod page;
mod svg;

pub use page::closed_loop;
pub use svg::{Chart, Series};
