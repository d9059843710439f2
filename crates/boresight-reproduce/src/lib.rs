//! The papers' tables and figures at one command: Monte Carlo of their scenes with our parts, side by side with the print.
//!
//! [`ITEMS`] lists what can be reproduced; each item gives sections (a table under one reading, with a sentence that says what
//! it means) and figures. Runs are spread over all cores and gathered in order: the same seed gives the same numbers.

pub mod bench_scene;
mod figures;
mod figures_fusion;
pub mod follow;
pub mod html;
pub mod initiation;
pub mod item;
mod lms;
pub mod printed;
pub mod scene_study;
pub mod score;
mod sensor_fusion;
mod spatial;
mod srif;
pub mod study;
mod tracking;

pub use item::{Figure, Item, Line, Output, Row, Section};
pub use study::Options;

/// Everything that can be reproduced, in the papers' order.
pub const ITEMS: &[Item] = &[
    Item {
        name: "ctudf-1",
        what: "Roopa et al. 2016, Table 1: CTUDF for five target noises",
        studies: 5,
        make: tracking::ctudf_table_1,
    },
    Item { name: "nnkf-4.1", what: "Thesis Table 4.1: NNKF on data set I", studies: 1, make: tracking::nnkf_table_41 },
    Item { name: "nnkf-4.2", what: "Thesis Table 4.2: NNKF on data set II", studies: 1, make: tracking::nnkf_table_42 },
    Item {
        name: "fusion-4.3",
        what: "Thesis Table 4.3: track fusion without loss",
        studies: 2,
        make: sensor_fusion::table_43,
    },
    Item {
        name: "fusion-4.4",
        what: "Thesis Table 4.4: track fusion with loss",
        studies: 2,
        make: sensor_fusion::table_44,
    },
    Item { name: "srif-1", what: "Parimala and Raol, Table 1: CTSRIF and CTFSRIF", studies: 1, make: srif::table_1 },
    Item { name: "srif-2", what: "Parimala and Raol, Table 2: CTSRIF and CTFSRIF", studies: 1, make: srif::table_2 },
    Item {
        name: "srif-3-4",
        what: "Parimala and Raol, Tables 3, 4: two imagers and their fusion",
        studies: 2,
        make: srif::tables_3_4,
    },
    Item {
        name: "filters-4.2",
        what: "Thesis Figure 4.2: mean and median filters",
        studies: 1,
        make: spatial::figure_42,
    },
    Item {
        name: "lms-2-4",
        what: "Obolensky et al. 2002, Figures 2-4: the LMS filter on manoeuvres",
        studies: 5,
        make: lms::figures_2_to_4,
    },
    Item {
        name: "ds2-pipeline",
        what: "data set II through the product's own detector, tracker and confirmation rule",
        studies: 3,
        make: initiation::pipeline_ds2,
    },
    Item { name: "figures", what: "the papers' figures of tracking, from one run", studies: 0, make: figures::figures },
];
