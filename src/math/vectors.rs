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
