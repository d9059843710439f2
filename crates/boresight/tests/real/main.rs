//! Tests of real data and of the program `ffmpeg`, which not every machine has: each test says what it needs, and shows as ignored,
//! with the reason, where that is missing. Where it is there the test runs, and any error fails it.
//!
//! The data lie in the folder that `BORESIGHT_TEST_DATA` names (default: `../shared/data` beside the repository).

mod auto;
mod camera;
mod colour;
mod disturbed;
mod follow;
mod fuse;
mod kitti_scores;
#[path = "../it/metrics/lcg.rs"]
mod lcg;
mod mot_scores;
mod needs;
mod overlay;
mod radar;
mod spots;
mod tables;
mod video;

fn main() -> std::process::ExitCode {
    let tests = [
        auto::tests(),
        camera::tests(),
        colour::tests(),
        disturbed::tests(),
        fuse::tests(),
        kitti_scores::tests(),
        mot_scores::tests(),
        overlay::tests(),
        radar::tests(),
        spots::tests(),
        tables::tests(),
        video::tests(),
    ];
    let trials = tests.into_iter().flatten().map(needs::Test::trial).collect();
    libtest_mimic::run(&libtest_mimic::Arguments::from_args(), trials).exit_code()
}
