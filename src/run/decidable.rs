//! Claims that no number of passes could decide: properties of the estimators that are known beforehand make
//! their tests invalid.

use super::job::{Job, Passes};
use crate::error::{Error, Refusals, Result};
use crate::estimators::Bias;
use crate::experiment::Experiment;
use crate::experiment::schema::Expect;
use crate::results::record::{Against, Comparison, Quantity};

/// Every claim that two means are equal is about one integral, and about estimators without bias, unless
/// it is a control that expects the difference or the invalid test.
///
/// # Errors
/// The claims that are not, each at its place.
pub(super) fn check(experiment: &Experiment, comparisons: &[Comparison], jobs: &[Job]) -> Result<()> {
    let jobs: Vec<&Passes> = jobs.iter().filter_map(Job::passes).collect();
    let find = |q: &Quantity| jobs.iter().find(|job| job.cell == q.cell && job.arm.name == q.estimator);
    let mut refusals = Refusals::default();
    let mut done = std::collections::BTreeSet::new();
    for comparison in comparisons {
        let claim = &experiment.file.claim[comparison.claim];
        let is_control = claim.differs.is_some() || claim.expect.is_some_and(|e| e != Expect::Fails);
        let other = match &comparison.against {
            Against::Value { .. } => continue,
            Against::Quantity { other, .. } => other,
            Against::Efficiency { baseline, .. } => baseline,
        };
        let quantity = &comparison.quantity;
        let names = (comparison.claim, quantity.cell, &quantity.estimator, other.cell, &other.estimator);
        if is_control || !done.insert(names) {
            continue;
        }
        let (Some(a), Some(b)) = (find(quantity), find(other)) else { continue };
        let place = || {
            let key = format!("claim.{}.{}", comparison.claim, claim.kind());
            experiment.sources.place(quantity.cell, &key)
        };
        let label = experiment.cells.get(quantity.cell).map_or("", |cell| &cell.label);
        if let Err(error) = one_integral(a, b) {
            refusals.keep::<()>(label, Err(error.at(place())))?;
        }
    }
    refusals.none_in(experiment.cells.len())
}

/// Two estimators have the same mean.
fn one_integral(a: &Passes, b: &Passes) -> Result<()> {
    let biased = [a, b].into_iter().find_map(|job| match job.estimator.bias() {
        Bias::Biased(why) => Some((job, why)),
        Bias::Unbiased | Bias::Consistent => None,
    });
    if let Some((job, why)) = biased {
        return Err(Error::input_help(
            format!("`{}` is biased here and can agree with no other: {why}", job.arm.name),
            "leave it out of the claim; a control that shows it takes `expect = \"invalid\"` and \
             `because = \"biased\"`",
        ));
    }
    let models = [a, b].map(|job| job.estimator.model());
    if models[0] == models[1] {
        return Ok(());
    }
    let said = [a, b].map(|job| {
        let model = job.estimator.model().unwrap_or_else(|| "light transport".into());
        format!("`{}` estimates {model}", job.arm.name)
    });
    Err(Error::input_help(
        format!("{} and {}: their means differ by the model's error", said[0], said[1]),
        "leave the claim out: the report measures the error of a model without one; `differs` claims that \
         there is one",
    ))
}
