//! The budget's journal: any flash before it, any calls, power cuts at any of their writes.

use armor_core::units::Cost;
use armor_infer::journal::{Journal, Reserve};
use armor_infer::log::LogError;

use crate::flash::{BYTES, Flash, PowerCut};
use crate::input::Input;

const REGION: std::ops::Range<u32> = 0..BYTES as u32;

/// Whatever happens, what is left after a reset is at most what was left
/// before it, or the budget of the episode that was about to begin.
pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let reserve = Reserve { step: Cost::from_raw(input.half().into()), ahead: Cost::from_raw(input.half().into()) };
    let open = |flash| Journal::open(flash, REGION, reserve).expect("the region is good and the power on");
    let mut journal = open(found(&mut input));
    while !input.is_empty() {
        let (choice, kappa) = (input.byte(), Cost::from_raw(input.word() >> 8));
        let (floor, episode) = (journal.remaining(), journal.episode());
        let begins = choice.is_multiple_of(4);
        let kappa = if begins { kappa } else { kappa.min(floor.saturating_add(reserve.step)) };
        if choice & 0b100 != 0 {
            let mut flash = journal.into_flash();
            flash.cut = Some((u32::from(choice >> 3) % 8, kappa.to_raw()));
            journal = open(flash);
        }
        let done = if begins { journal.begin(kappa) } else { journal.cover(kappa) };
        match done {
            Ok(()) => assert!(journal.remaining() <= kappa.saturating_sub(reserve.step)),
            Err(ref error) => assert_eq!(error, &LogError::Flash(PowerCut)),
        }
        if done.is_err() || choice & 0b10 != 0 {
            let known = journal.remaining();
            let mut flash = journal.into_flash();
            flash.cut = None;
            journal = open(flash);
            let at_most = match journal.episode() {
                same if same == episode => floor,
                _ => kappa.saturating_sub(reserve.step),
            };
            assert!(journal.remaining() <= at_most, "{} of {at_most} left", journal.remaining());
            assert!(done.is_err() || journal.remaining() == known, "what was acknowledged is found again");
        }
    }
}

/// Flash that is erased, or holds bytes of the input, over and over.
fn found(input: &mut Input<'_>) -> Flash {
    let mut flash = Flash::erased();
    let length = input.byte().into();
    for (out, byte) in flash.bytes.iter_mut().zip(input.slice(length).iter().cycle()) {
        *out = *byte;
    }
    flash
}
