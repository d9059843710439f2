//! Tables of tracks in memory: what evaluation reads and what the formats convert.

mod builder;
mod column;
mod row;
mod row_state;
mod state;
mod table;

pub use builder::TrackTableBuilder;
pub use column::Column;
pub use row::{PixelOrigin, TrackRow};
pub use state::{RowState, StateColumns};
pub use table::TrackTable;
