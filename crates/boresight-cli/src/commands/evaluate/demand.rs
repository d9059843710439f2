//! Checks the scores that `--require` demands.

use crate::console::say;
use boresight::metrics::evaluation::{Better, Value};
use boresight::{Error, ErrorKind};
use std::process::ExitCode;

/// What a score is held to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// At least or at most this, whichever way the measure is better.
    Good(f64),
    /// From the first to the second, both included.
    Between(f64, f64),
}

/// A measure by name and what its score is held to.
pub type Demand = (String, Limit);

/// Reads `HOTA=0.4` or `ANEES=1.5..2.5`.
/// # Errors
/// What is wrong with the text.
pub fn demand(text: &str) -> Result<Demand, String> {
    let (name, value) = text.split_once('=').ok_or("expected MEASURE=VALUE, for instance HOTA=0.4")?;
    let number = |value: &str| {
        let number = value.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        number.ok_or_else(|| format!("expected a number after =, or two as in 1.5..2.5; found \"{value}\""))
    };
    let limit = match value.split_once("..") {
        None => Limit::Good(number(value)?),
        Some((from, to)) => {
            let (from, to) = (number(from)?, number(to)?);
            if from > to {
                return Err(format!("expected the lower number first, found {from}..{to}"));
            }
            Limit::Between(from, to)
        }
    };
    Ok((name.trim().to_string(), limit))
}

/// Whether the demands are met, as an exit code.
/// # Errors
/// A measure that is not known or was not computed; a single number for one that is best in between.
pub fn met(demands: &[Demand], combined: &[Value]) -> anyhow::Result<ExitCode> {
    let mut met = true;
    for (name, limit) in demands {
        let found = combined.iter().find(|v| v.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known: Vec<&str> = combined.iter().map(|v| v.name).collect();
            Error::new(ErrorKind::Config, "no such measure")
                .at(format!("--require {name}"))
                .hint(format!("one of {}", known.join(", ")))
        })?;
        if let Some(unmet) = unmet(found, *limit)? {
            met = false;
            say!("not met: {unmet}");
        }
    }
    Ok(if met { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// What is said of a score outside its limit; nothing of one within.
fn unmet(found: &Value, limit: Limit) -> boresight::Result<Option<String>> {
    let (name, value) = (found.name, found.value);
    let (ok, demanded) = match (limit, found.better) {
        (Limit::Between(from, to), _) => ((from..=to).contains(&value), format!("{from} to {to}")),
        (Limit::Good(limit), Better::Higher) => (value >= limit, format!("at least {limit}")),
        (Limit::Good(limit), Better::Lower) => (value <= limit, format!("at most {limit}")),
        (Limit::Good(limit), Better::Neither) => {
            let what = "neither a larger nor a smaller value is better: expected a range";
            return Err(Error::new(ErrorKind::Config, what).at(format!("--require {name}={limit}")).hint(format!(
                "two numbers, for instance {name}={}..{}",
                limit - 0.5,
                limit + 0.5
            )));
        }
    };
    Ok((!ok).then(|| format!("{name} = {value:.6}, demanded {demanded}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demand_is_a_limit_or_a_range() {
        assert_eq!(demand("HOTA = 0.4"), Ok(("HOTA".into(), Limit::Good(0.4))));
        assert_eq!(demand("bias_x=-0.5..0.5"), Ok(("bias_x".into(), Limit::Between(-0.5, 0.5))));
        assert!(demand("ANEES=2..1").unwrap_err().contains("the lower number first"));
        for wrong in ["ANEES", "ANEES=", "ANEES=1..", "ANEES=..2", "ANEES=1..inf", "ANEES=1..2..3"] {
            assert!(demand(wrong).unwrap_err().starts_with("expected"), "{wrong}");
        }
    }
}
