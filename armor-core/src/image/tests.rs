use super::fixture::{Aligned, Parts, SHAPE, TINY, resealed, seal, word, words};
use super::*;
use crate::schedule::{ChainStep, Sampler, Schedule};
use std::vec::Vec;

#[test]
fn what_was_written_is_read_back_in_place() {
    let parts = Parts::new(SHAPE);
    let (mut memory, length) = parts.build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    assert_eq!(image.bytes().len(), length);

    let manifest = Manifest { sections: Default::default(), ..image.manifest().clone() };
    assert_eq!(manifest, parts.manifest);
    let numbers = image.sections();
    let dense = |layer: &Dense<'_>| [layer.weights, layer.bias].concat();
    let [kappa_1, kappa_2, kappa_3] = &numbers.kappa;
    let context = &numbers.context_state;
    let read = [
        [numbers.state_mean, numbers.state_factor].concat(),
        [numbers.action_low, numbers.action_high, numbers.action_fallback].concat(),
        dense(kappa_1),
        dense(kappa_2),
        dense(kappa_3),
        [context.weights, numbers.context_kappa, context.bias].concat(),
        numbers.time_table.to_vec(),
        numbers.action_input.to_vec(),
        dense(&numbers.hidden_2),
        dense(&numbers.hidden_3),
        dense(&numbers.output),
    ];
    for (read, written) in read.iter().zip(&parts.contents) {
        assert_eq!(&words(read), written);
    }
    assert_eq!((kappa_3.bias.len(), context.weights.len(), numbers.context_kappa.len()), (6, 3 * 5, 6 * 5));

    let chain = |index| numbers.chain(image.manifest(), index).collect::<Vec<_>>();
    let expected = |sampler, steps| Schedule::vp(7).chain(sampler, steps).map(ChainStep::<f64>::to_f32);
    assert_eq!(chain(0), expected(Sampler::Ddpm, 7).collect::<Vec<_>>());
    assert_eq!(chain(1), expected(Sampler::Ddim, 1).collect::<Vec<_>>());
    assert_eq!(chain(2), []);

    assert_eq!((numbers.golden.seed, numbers.golden.limit.to_f32()), (8 << 32 | 7, 5.0));
    let [row] = numbers.golden.rows().collect::<Vec<_>>()[..] else { panic!("one row was written") };
    assert_eq!(words(row.state), [0, 1, 2].map(|i| word(13, i)));
    assert_eq!((row.incurred.to_bits(), row.kappa.to_raw()), (word(13, 3), word(13, 4)));
    assert_eq!(words(row.action), [5, 6].map(|i| word(13, i)));
}

#[test]
fn every_change_of_any_byte_is_named() {
    let (mut memory, length) = Parts::new(TINY).build();
    for at in 0..length {
        for mask in 1..=255 {
            memory.bytes()[at] ^= mask;
            let error = PolicyImage::new_checked(memory.bytes()).map(drop).unwrap_err();
            let expected = match at {
                0..4 => ImageError::Magic,
                4..6 => ImageError::Version(u16::from_le_bytes([memory.bytes()[4], memory.bytes()[5]])),
                6..HEADER_BYTES => ImageError::Header,
                _ => ImageError::Checksum,
            };
            assert_eq!(error, expected, "byte {at}, mask {mask:#04x}");
            memory.bytes()[at] ^= mask;
        }
    }
}

#[test]
fn every_truncation_is_named() {
    let (mut memory, length) = Parts::new(TINY).build();
    for actual in 0..length {
        let expected = if actual < HEADER_BYTES { HEADER_BYTES } else { length };
        let error = PolicyImage::new_checked(&memory.bytes()[..actual]).map(drop);
        assert_eq!(error, Err(ImageError::Truncated { expected, actual }));
    }
}

#[test]
fn only_a_multiple_of_16_is_an_address() {
    let (mut memory, length) = Parts::new(TINY).build();
    memory.0.push(0);
    for shift in 1..=16 {
        memory.bytes().copy_within(shift - 1..shift - 1 + length, shift);
        let read = PolicyImage::new_checked(&memory.bytes()[shift..]).map(drop);
        assert_eq!(read, if shift == 16 { Ok(()) } else { Err(ImageError::Misaligned) });
    }
}

#[test]
fn what_follows_the_image_is_ignored() {
    let (mut memory, length) = Parts::new(TINY).build();
    memory.bytes()[length..].fill(0xff);
    assert_eq!(PolicyImage::new_checked(memory.bytes()).unwrap().bytes().len(), length);
}

#[test]
fn a_buffer_that_is_too_small_is_full() {
    let parts = Parts::new(TINY);
    let (_, length) = parts.build();
    let mut memory = Aligned::zeros(length);
    for short in 0..length {
        assert_eq!(parts.write_into(&mut memory.bytes()[..short]), Err(WriteError::Full));
    }
    assert_eq!(parts.write_into(&mut memory.bytes()[..length]), Ok(length));
}

#[test]
fn a_section_of_the_wrong_length_is_named() {
    let required = SectionKind::ALL.into_iter().filter(|kind| !kind.is_optional());
    for kind in required {
        let mut longer = Parts::new(SHAPE);
        longer.section(kind).push(0);
        assert_eq!(longer.fault(), ImageError::Section(kind));
        let mut shorter = Parts::new(SHAPE);
        shorter.section(kind).pop();
        assert_eq!(shorter.fault(), ImageError::Section(kind));
    }
}

#[test]
fn a_number_that_is_not_finite_is_named() {
    for kind in &SectionKind::ALL[..11] {
        for bad in [f32::NAN, f32::INFINITY] {
            let mut parts = Parts::new(SHAPE);
            *parts.section(*kind).last_mut().unwrap() = bad.to_bits();
            assert_eq!(parts.fault(), ImageError::NotFinite(*kind));
        }
    }
}

#[test]
fn the_section_table_leaves_no_choice() {
    assert_eq!(resealed(|_| ()), Ok(()));
    let first = Err(ImageError::Section(SectionKind::StateNormaliser));
    let last = Err(ImageError::Section(SectionKind::Golden));
    assert_eq!(resealed(|manifest| manifest.sections.swap(0, 1)), first);
    assert_eq!(resealed(|manifest| manifest.sections[0].offset = 16), first);
    assert_eq!(resealed(|manifest| manifest.sections[12].offset += 16), last);
    assert_eq!(resealed(|manifest| manifest.sections[12].length = u32::MAX), last);
    assert_eq!(resealed(|manifest| manifest.sections.truncate(12)), last);
    assert_eq!(resealed(|manifest| manifest.sections.clear()), first);
}

#[test]
fn a_manifest_out_of_range_is_named() {
    assert_eq!(resealed(|manifest| manifest.shape.hidden = 1025), Err(ImageError::Shape));
    assert_eq!(resealed(|manifest| manifest.schedule.steps = 8), Err(ImageError::Chain));
    assert_eq!(resealed(|manifest| manifest.rungs.clear()), Err(ImageError::Chain));
    assert_eq!(resealed(|manifest| manifest.rungs.reverse()), Err(ImageError::Chain));
    assert_eq!(resealed(|manifest| manifest.rungs[0].steps = 0), Err(ImageError::Chain));
    assert_eq!(resealed(|manifest| manifest.rungs[0].steps = 8), Err(ImageError::Chain));
    for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(resealed(|manifest| manifest.kappa.scale = scale), Err(ImageError::KappaRange));
    }
}

#[test]
fn manifest_bytes_that_say_more_or_less_are_refused() {
    let encoded = [0; 8];
    assert_eq!(seal(&encoded, 0, &[], 8), Err(ImageError::Manifest), "cut short");
    assert_eq!(seal(&encoded, 0, &[], 17), Err(ImageError::Header), "longer than the image");
    assert_eq!(seal(&encoded, 0, &[], u32::MAX as usize), Err(ImageError::Header));

    let (mut memory, length) = Parts::new(TINY).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let mut buffer = [0; 1024];
    let encoded = postcard::to_slice(image.manifest(), &mut buffer).unwrap();
    let padded = encoded.len().next_multiple_of(ALIGNMENT);
    assert_ne!(encoded.len(), padded, "no padding to test with");
    let body = &image.bytes()[HEADER_BYTES + padded..length];
    assert_eq!(seal(encoded, 0, body, encoded.len()), Ok(()));
    assert_eq!(seal(encoded, 1, body, encoded.len()), Err(ImageError::Manifest), "padding is not zero");
    assert_eq!(seal(encoded, 0, body, encoded.len() + 1), Err(ImageError::Manifest), "a byte too many");
}

#[test]
fn a_chain_goes_down_and_ends_at_the_estimate() {
    let edited = |step: usize, word: usize, value: u32| {
        let mut parts = Parts::new(SHAPE);
        parts.section(SectionKind::Chain)[step * ChainStep::WORDS + word] = value;
        parts.fault()
    };
    assert_eq!(edited(0, 0, 8), ImageError::Chain, "above N");
    assert_eq!(edited(1, 0, 7), ImageError::Chain, "not lower than before");
    assert_eq!(edited(6, 0, 0), ImageError::Chain, "level 0");
    for word in 1..ChainStep::WORDS {
        assert_eq!(edited(3, word, f32::NAN.to_bits()), ImageError::Chain);
    }
    for word in 3..ChainStep::WORDS {
        assert_eq!(edited(6, word, 0.5f32.to_bits()), ImageError::Chain);
        assert_eq!(edited(7, word, 0.5f32.to_bits()), ImageError::Chain, "the second rung ends there too");
    }
}

fn with_map(knots: &[[u32; 2]]) -> Parts {
    let mut parts = Parts::new(SHAPE);
    *parts.section(SectionKind::BudgetMap) = knots.concat();
    parts
}

#[test]
fn a_budget_map_is_read_back_and_an_image_without_one_has_no_trace_of_it() {
    let knots = [[0, 0.25f32.to_bits()], [5 << 16, 0.75f32.to_bits()]];
    let (mut memory, _) = with_map(&knots).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let map = image.sections().budget_map.unwrap();
    assert_eq!(
        map.knots().map(|(budget, condition)| [budget.to_raw(), condition.to_bits()]).collect::<Vec<_>>(),
        knots
    );
    assert_eq!(image.manifest().sections.len(), SECTION_COUNT);

    let (mut memory, _) = Parts::new(SHAPE).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    assert_eq!((image.sections().budget_map, image.manifest().sections.len()), (None, SECTION_COUNT - 1));
}

#[test]
fn a_budget_map_out_of_order_is_named() {
    let one = 1f32.to_bits();
    for knots in [&[[0, one]][..], &[[5, 0], [5, one]], &[[5, one], [6, 0]], &[[5, 0], [6, f32::NAN.to_bits()]]] {
        assert_eq!(with_map(knots).fault(), ImageError::BudgetMap, "{knots:?}");
    }
    let mut half = with_map(&[[0, 0], [1, one]]);
    half.section(SectionKind::BudgetMap).push(2);
    assert_eq!(half.fault(), ImageError::Section(SectionKind::BudgetMap));
}

#[test]
fn bounds_hold_the_fallback() {
    for (at, value) in [(0, 0.5f32), (2, -0.5), (4, 1.5), (5, -1.5)] {
        let mut parts = Parts::new(SHAPE);
        parts.section(SectionKind::ActionBounds)[at] = value.to_bits();
        assert_eq!(parts.fault(), ImageError::Bounds);
    }
}
