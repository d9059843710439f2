//! What the caller adds to the report: input, facts, settings with reasons, warnings, times.

/// What the report says besides what it saw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Notes {
    /// Title; empty: the input's name.
    pub title: String,
    /// Name of the input.
    pub input: String,
    /// What is thought of the run, a sentence, and whether it is doubted; the page begins with it.
    pub verdict: Option<(String, bool)>,
    /// Options of the same command to try next.
    pub next: Option<String>,
    /// The command that shows what each detector finds, where that may help.
    pub look: Option<String>,
    /// Further lines of the summary: name and value.
    pub facts: Vec<(String, String)>,
    /// The settings chosen, each with its reason, one line each.
    pub settings: Vec<String>,
    /// The configuration in full, as it stands in a file.
    pub configuration: Option<String>,
    /// Warnings, each a whole sentence.
    pub warnings: Vec<String>,
    /// Time spent in each stage, s.
    pub stages: Vec<(String, f64)>,
}
