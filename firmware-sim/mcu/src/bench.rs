//! Actions without a line: what an instruction counter is to see.

use armor_core::image::PolicyImage;
use armor_infer::link::{Answer, Request, VERSION};
use heapless::Vec;

use crate::console::tell;
use crate::{McuEndpoint, Stop};

/// Answers `actions` observations of an episode, whose states are those of the
/// golden trace, again and again.
pub(crate) fn run(endpoint: &mut McuEndpoint, image: &PolicyImage<'_>, actions: u32) -> Result<(), Stop> {
    let golden = &image.sections().golden;
    endpoint.answer(&Request::Hello { version: VERSION });
    endpoint.answer(&Request::Reset { episode: 1, limit: golden.limit, seed: golden.seed });
    let mut checksum = 0;
    let mut rows = golden.rows();
    for tick in 0..actions {
        let row = rows.next().or_else(|| {
            rows = golden.rows();
            rows.next()
        });
        let row = row.ok_or(c"failed golden")?;
        let state = Vec::from_slice(row.state).map_err(|_| c"failed golden")?;
        let request = Request::Observe { episode: 1, tick, incurred: 0.0, state };
        let Some(Answer::Act { action, .. }) = endpoint.answer(&request) else { return Err(c"failed action") };
        checksum = action.iter().fold(checksum, |sum: u32, entry| sum.rotate_left(5) ^ entry.to_bits());
    }
    tell(c"checksum", checksum);
    Ok(())
}
