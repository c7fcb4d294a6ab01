//! Flights of whatever image parses, through any states, costs and step limits.

use armor_core::image::PolicyImage;
use armor_core::units::{Cost, CostLimit};
use armor_infer::{Controller, Fault, Kernel, Policy, Step};

use crate::image::{ACTION, HIDDEN, STATE, edited};
use crate::input::Input;

/// Wrong bytes of an image, at most.
const EDITS: usize = 8;

/// Every step ends with an action within the bounds or the fallback, kappa only
/// falls within an episode, and all kernels of this machine agree on every bit.
pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let edits = usize::from(input.byte()) % EDITS;
    let memory = edited(&mut input, edits);
    let Ok(image) = PolicyImage::new_checked(memory.as_slice()) else { return };
    let Ok(policy) = Policy::load(&image) else { return };
    let limit = CostLimit::from_cost(Cost::from_raw(input.word()));
    let start = |kernel| Controller::<STATE, ACTION, HIDDEN>::new(policy.with_kernel(kernel), limit, 1);
    let Ok(mut controllers) = Kernel::available().map(start).collect::<Result<Vec<_>, _>>() else { return };

    let mut kappa = limit.cost();
    while !input.is_empty() {
        let choice = input.byte();
        if choice == 0 {
            let (limit, seed) = (CostLimit::from_cost(Cost::from_raw(input.word())), input.byte().into());
            let begun = controllers.iter_mut().map(|controller| controller.new_episode(limit, seed));
            if begun.collect::<Result<Vec<_>, _>>().is_ok() {
                kappa = limit.cost();
            }
            continue;
        }
        // A wrong length now and then, and the policy's own else.
        let entries = if choice == 1 { input.byte().into() } else { usize::from(policy.shape().state) };
        let state: Vec<f32> = (0..entries).map(|_| input.float()).collect();
        let (incurred, steps) = (input.float(), usize::from(choice) / 2);
        let flown: Vec<Step<ACTION>> =
            controllers.iter_mut().map(|controller| controller.step_within(&state, incurred, steps)).collect();
        check(&image, kappa, &flown[0]);
        kappa = flown[0].kappa;
        let bits = |step: &Step<ACTION>| (step.action.map(f32::to_bits), step.kappa, step.rung, step.fault);
        for (step, kernel) in flown.iter().zip(Kernel::available()) {
            assert_eq!(bits(step), bits(&flown[0]), "{}", kernel.name());
        }
    }
}

fn check(image: &PolicyImage<'_>, before: Cost, step: &Step<ACTION>) {
    let sections = image.sections();
    let (action, beyond) = step.action.as_slice().split_at(sections.action_low.len());
    assert!(beyond.iter().all(|&entry| entry == 0.0), "{step:?}");
    assert!(step.kappa <= before, "{step:?} after {before}");
    match step.fault {
        None | Some(Fault::InvalidCost) => {
            assert!(step.rung.is_some_and(|rung| rung < image.manifest().rungs.len()), "{step:?}");
            let mut bounds = action.iter().zip(sections.action_low.iter().zip(sections.action_high));
            assert!(bounds.all(|(entry, (low, high))| low <= entry && entry <= high), "{step:?}");
        }
        Some(_) => assert_eq!((action, step.rung), (sections.action_fallback, None), "{step:?}"),
    }
}
