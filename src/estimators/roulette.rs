//! Russian roulette.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sampling::stream::Stream;

/// Russian roulette: when a path is ended by chance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Roulette {
    /// At every scattering event with probability 1 - albedo: the weight never changes.
    Analog {},
    /// Only where the path's weight has fallen below this: it survives with probability weight over
    /// threshold and continues with the threshold as weight.
    Below(#[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))] f64),
}

impl Default for Roulette {
    fn default() -> Self {
        Roulette::Below(0.25)
    }
}

impl Roulette {
    /// At a medium vertex: multiplies a path's weights, of which the second is what roulette sees, by `factor`, or ends the
    /// path (`None`). A threshold is compared with the weight times `importance`.
    #[inline]
    pub(super) fn survive(
        self,
        [throughput, survival]: [&mut f64; 2],
        factor: f64,
        importance: impl FnOnce() -> f64,
        stream: &mut Stream,
    ) -> Option<()> {
        match self {
            Roulette::Analog {} => (stream.draw() < factor).then_some(()),
            Roulette::Below(threshold) => {
                *throughput *= factor;
                *survival *= factor;
                let expected = *survival * importance();
                if expected < threshold {
                    let probability = roulette(expected, threshold, || stream.draw())?;
                    *throughput /= probability;
                    *survival /= probability;
                }
                Some(())
            }
        }
    }
}

/// Russian roulette on a weight: above the threshold it is unchanged, below it survives with
/// probability weight / threshold. Returns the probability to divide by.
#[inline]
pub(super) fn roulette(weight: f64, threshold: f64, u: impl FnOnce() -> f64) -> Option<f64> {
    if weight >= threshold {
        return Some(1.0);
    }
    let probability = weight / threshold;
    (u() < probability).then_some(probability)
}
