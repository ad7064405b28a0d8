//! Loops over lanes, compiled for the vector instructions of the machine. The only module that uses `pulp`.

/// Work for [`vectorized`]. `call` and what its loops call are `inline(always)`: what is not inlined is compiled for the
/// least machine.
pub(crate) use pulp::NullaryFnOnce as Vectorized;

/// Does the work with the widest vectors that it is compiled for and the machine has. Products and sums are rounded one by
/// one with all of them, so that the result is the same.
#[inline]
pub(crate) fn vectorized<W: Vectorized>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
}

/// A function of one number that is not negative, for [`of_each`].
pub(crate) trait Lanewise {
    /// Its value anywhere.
    fn at(&self, x: f64) -> f64;

    /// The same bits below [`Self::reach`]: `inline(always)` and without branches.
    fn near(&self, x: f64) -> f64;

    /// Where [`Self::near`] ends.
    fn reach(&self) -> f64;
}

/// `values` = f(x) of each x.
#[inline]
pub(crate) fn of_each<F: Lanewise>(f: &F, x: &[f64], values: &mut [f64]) {
    let reach = f.reach();
    if x.iter().all(|x| *x < reach) {
        vectorized(OfEach { f, x, values });
    } else {
        values.iter_mut().zip(x).for_each(|(value, x)| *value = f.at(*x));
    }
}

struct OfEach<'a, F> {
    f: &'a F,
    x: &'a [f64],
    values: &'a mut [f64],
}

impl<F: Lanewise> Vectorized for OfEach<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (value, x) in self.values.iter_mut().zip(self.x) {
            *value = self.f.near(*x);
        }
    }
}
