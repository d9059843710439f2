//! What a user asks of the automatic choice; everything else it decides by what it sees.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

/// A detector asked for by its word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DetectorKind {
    /// Targets of any size that stand clear of their surroundings.
    Isolated,
    /// Small and faint targets at a stated rate of false alarms.
    Cfar,
    /// Small moving targets that no single frame shows.
    Integrate,
    /// Small targets that no single frame shows and that turn.
    Bernoulli,
    /// What moves before a fixed camera.
    Moving,
    /// What moves before a moving camera.
    Steadied,
    /// Many small spots: particles, seeds, stars.
    Spot,
    /// Bright compact pieces on an even dark ground: cells, nuclei.
    Local,
    /// A moving thing told by its colour, before a fixed camera.
    Colour,
}

impl DetectorKind {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Self; 9] = [
        Self::Isolated,
        Self::Cfar,
        Self::Integrate,
        Self::Moving,
        Self::Steadied,
        Self::Spot,
        Self::Local,
        Self::Colour,
        Self::Bernoulli,
    ];

    /// Its number among the candidates that a preview shows; 1 is the choice without options.
    pub fn candidate(self) -> usize {
        Self::ALL.iter().position(|k| *k == self).map_or(1, |i| i + 2)
    }

    /// The candidate of a number: `None` for 1, the choice without options.
    /// # Errors
    /// A number that no candidate has, with the list.
    pub fn of_candidate(number: usize) -> crate::Result<Option<Self>> {
        let of = |i: usize| Self::ALL.get(i).copied();
        match number {
            1 => Ok(None),
            _ => number.checked_sub(2).and_then(of).map(Some).ok_or_else(|| {
                let all = Self::ALL.map(|k| format!("{} {k}", k.candidate())).join(", ");
                crate::Error::new(crate::ErrorKind::Config, "there is no such candidate").at(number).hint(format!(
                    "1 the choice without options, {all}; `boresight preview INPUT` shows what each finds"
                ))
            }),
        }
    }

    /// Its word: the key below `detector.threshold`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Isolated => "isolated",
            Self::Cfar => "cfar",
            Self::Integrate => "integrate",
            Self::Bernoulli => "bernoulli",
            Self::Moving => "moving",
            Self::Steadied => "steadied",
            Self::Spot => "spot",
            Self::Local => "local",
            Self::Colour => "colour",
        }
    }

    /// What it is for, a few words.
    pub const fn purpose(self) -> &'static str {
        match self {
            Self::Isolated => "targets of any size that stand clear of their surroundings",
            Self::Cfar => "small and faint targets at a stated rate of false alarms",
            Self::Integrate => "small moving targets that no single frame shows",
            Self::Bernoulli => "small targets that no single frame shows and that turn",
            Self::Moving => "what moves before a fixed camera",
            Self::Steadied => "what moves before a moving camera",
            Self::Spot => "many small spots: particles, seeds, stars",
            Self::Local => "bright compact pieces on an even dark ground: cells",
            Self::Colour => "one moving thing of a colour of its own before a fixed camera",
        }
    }
}

impl fmt::Display for DetectorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for DetectorKind {
    type Err = crate::Error;

    fn from_str(word: &str) -> crate::Result<Self> {
        Self::ALL.into_iter().find(|k| k.name() == word).ok_or_else(|| {
            let all = Self::ALL.map(|k| format!("{} ({})", k.name(), k.purpose())).join(", ");
            crate::Error::new(crate::ErrorKind::Config, "there is no such detector to choose").at(word).hint(all)
        })
    }
}

/// What is asked of the choice; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request {
    /// Detector, where it is not to be chosen.
    pub detector: Option<DetectorKind>,
    /// False tracks an hour that are allowed.
    pub false_tracks_per_hour: Option<f64>,
    /// Threads to look on; as many as the machine has if absent.
    pub threads: Option<NonZeroUsize>,
}

impl Request {
    /// The number of threads.
    pub(super) fn n_threads(&self) -> usize {
        self.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, usize::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_means_its_candidate_and_another_is_refused_with_the_list() {
        assert_eq!(DetectorKind::of_candidate(1).unwrap(), None);
        for kind in DetectorKind::ALL {
            assert_eq!(DetectorKind::of_candidate(kind.candidate()).unwrap(), Some(kind));
        }
        for none in [0, DetectorKind::ALL.len() + 2, usize::MAX] {
            let error = DetectorKind::of_candidate(none).unwrap_err().to_string();
            assert!(error.contains(&none.to_string()) && error.contains("3 cfar"), "{error}");
        }
    }

    #[test]
    fn every_word_means_its_detector_and_another_is_refused_with_the_list() {
        for kind in DetectorKind::ALL {
            assert_eq!(kind.name().parse::<DetectorKind>().unwrap(), kind);
        }
        let error = "movng".parse::<DetectorKind>().unwrap_err().to_string();
        assert!(error.contains("movng") && error.contains("moving (what moves"), "{error}");
    }
}
