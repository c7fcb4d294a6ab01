use super::fixture::{Aligned, Parts, SHAPE, TINY, resealed, seal, word, words};
use super::*;
use crate::schedule::{ChainStep, Sampler, Schedule};
use crate::shape::Shape;
use std::vec;
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
    let Network::Float(network) = &numbers.network else { panic!("the fixture is in single precision") };
    let context = &network.context_state;
    let read = [
        [numbers.state_mean, numbers.state_factor].concat(),
        [numbers.action_low, numbers.action_high, numbers.action_fallback].concat(),
        dense(kappa_1),
        dense(kappa_2),
        dense(kappa_3),
        [context.weights, network.context_kappa, context.bias].concat(),
        network.time_table.to_vec(),
        network.action_input.to_vec(),
        dense(&network.hidden_2),
        dense(&network.hidden_3),
        dense(&network.output),
    ];
    for (read, written) in read.iter().zip(&parts.contents) {
        assert_eq!(&words(read), written);
    }
    for (kind, written) in SectionKind::ALL.into_iter().zip(&parts.contents) {
        assert_eq!(image.words(kind), written);
    }
    assert_eq!((kappa_3.bias.len(), context.weights.len(), network.context_kappa.len()), (6, 3 * 5, 6 * 5));

    let chain = |index| numbers.chain(image.manifest(), index).collect::<Vec<_>>();
    let expected = |sampler, steps| Schedule::vp(7).chain(sampler, steps).map(ChainStep::<f64>::to_f32);
    assert_eq!(chain(0), expected(Sampler::Ddpm, 7).collect::<Vec<_>>());
    assert_eq!(chain(1), expected(Sampler::Ddim, 1).collect::<Vec<_>>());
    assert_eq!(chain(2), []);

    assert_eq!((numbers.golden.seed, numbers.golden.limit.to_f32()), (8 << 32 | 7, 5.0));
    let [row] = numbers.golden.rows().collect::<Vec<_>>()[..] else { panic!("one row was written") };
    assert_eq!(words(row.state), [0, 1, 2].map(|i| word(14, i)));
    assert_eq!((row.incurred.to_bits(), row.kappa.to_raw()), (word(14, 3), word(14, 4)));
    assert_eq!(words(row.action), [5, 6].map(|i| word(14, i)));
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
        if shorter.section(kind).pop().is_some() {
            assert_eq!(shorter.fault(), ImageError::Section(kind));
        }
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
    assert_eq!(resealed(|manifest| manifest.sections[13].offset += 16), last);
    assert_eq!(resealed(|manifest| manifest.sections[13].length = u32::MAX), last);
    assert_eq!(resealed(|manifest| manifest.sections.truncate(13)), last);
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
    assert_eq!(seal(&encoded, 0, &[], 33), Err(ImageError::Header), "longer than the image");
    assert_eq!(seal(&encoded, 0, &[], u32::MAX as usize), Err(ImageError::Header));

    let (mut memory, length) = Parts::new(TINY).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let mut buffer = [0; 1024];
    let encoded = postcard::to_slice(image.manifest(), &mut buffer).unwrap();
    let padded = header::padded_manifest(encoded.len()).unwrap();
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
    // Without a critic.
    assert_eq!(image.manifest().sections.len(), SECTION_COUNT - 1);

    let (mut memory, _) = Parts::new(SHAPE).build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    assert_eq!((image.sections().budget_map, image.manifest().sections.len()), (None, SECTION_COUNT - 2));
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

#[test]
fn integers_that_were_written_are_read_back_in_place() {
    let parts = Parts::integers(SHAPE);
    let (mut memory, _) = parts.build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let Network::Integer(network) = image.sections().network else { panic!("the fixture is in integers") };
    // Words 1, 2, 3, ... times 0x04030201, byte by byte; the last word of a part is not used up.
    let bytes = |count: usize| (0..count as u32).map(|i| ((0x0403_0201 * (i / 4 + 1)) >> (8 * (i % 4))) as i8);
    let rows = |rows: Rows<'_>, count| {
        assert_eq!(rows.weights, bytes(count).collect::<Vec<i8>>());
        assert_eq!(rows.multiplier, [1, 2, 3, 4, 5]);
    };
    rows(network.context_state, 5 * 3);
    rows(network.context_kappa, 5 * 6);
    rows(network.hidden_2, 5 * 5);
    rows(network.hidden_3, 5 * 5);
    assert_eq!(network.output, bytes(2 * 2 * 5).collect::<Vec<i8>>());
    for bias in [network.context_bias, network.bias_2, network.bias_3] {
        assert_eq!(bias, [10, 9, 8, 7, 6]);
    }
    assert_eq!((network.time_table.len(), network.action_input.len()), (7 * 5, 2 * 5));
    assert_eq!(network.time_table[..3], [0x0201, 0x0403, 0x0402]);
    assert_eq!(words(network.output_factor), [0, 1].map(|i| word(9, i)));
    assert_eq!(words(network.output_bias), [2, 3].map(|i| word(9, i)));
    assert_eq!((network.state_unit, network.kappa_unit, network.action_factor), (1.5, 2.5, 3.5));
    assert_eq!((network.time_shift, network.action_shift), (1, 9));
    let level = LevelScales { activate: [7, 8, 9], rescale: [10, 11], last_scale: 0.5 };
    assert_eq!((network.level(0), network.level(7), network.level(8)), (None, Some(level), None));
}

#[test]
fn paired_weights_fill_whole_blocks() {
    let mut parts = Parts::integers(SHAPE);
    parts.manifest.layout = Layout::Paired;
    // 5 rows take two blocks of four, and so do 5 or 6 columns.
    let matrix = |bytes: u32| vec![0; bytes as usize / 4];
    let fives = vec![1; 5];
    let hidden = [matrix(8 * 8), fives.clone(), fives.clone()].concat();
    for (kind, words) in [
        (SectionKind::Context, [matrix(8 * 4), fives.clone(), matrix(8 * 8), fives.clone(), fives.clone()].concat()),
        (SectionKind::Hidden2, hidden.clone()),
        (SectionKind::Hidden3, hidden),
        (SectionKind::Output, [matrix(4 * 8), fives[..4].to_vec()].concat()),
    ] {
        assert_eq!(parts.fault(), ImageError::Section(kind), "in the lengths of rows");
        *parts.section(kind) = words;
    }
    let (mut memory, _) = parts.build();
    let image = PolicyImage::new_checked(memory.bytes()).unwrap();
    let Network::Integer(network) = image.sections().network else { panic!("the fixture is in integers") };
    assert_eq!((network.layout, network.context_state.weights.len(), network.output.len()), (Layout::Paired, 32, 32));
}

#[test]
fn weights_in_single_precision_have_one_layout() {
    let mut parts = Parts::new(SHAPE);
    parts.manifest.layout = Layout::Paired;
    assert_eq!(parts.fault(), ImageError::Manifest);
}

#[test]
fn an_integer_with_which_a_sum_might_overflow_is_named() {
    let edited = |kind: SectionKind, at: usize, value: u32| {
        let mut parts = Parts::integers(SHAPE);
        parts.section(kind)[at] = value;
        parts.fault()
    };
    // After the matrix come five multipliers, then five biases.
    for (kind, multiplier) in [(SectionKind::Context, 4), (SectionKind::Hidden2, 7), (SectionKind::Hidden3, 7)] {
        for value in [0, -1i32 as u32] {
            assert_eq!(edited(kind, multiplier + 4, value), ImageError::OutOfRange(kind));
        }
        let last = Parts::integers(SHAPE).section(kind).len() - 1;
        for value in [(1 << 28) + 1, -(1 << 28) - 1, i32::MIN] {
            assert_eq!(edited(kind, last, value as u32), ImageError::OutOfRange(kind));
        }
    }
    let scales = ImageError::OutOfRange(SectionKind::Scales);
    for at in 0..3 {
        for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(edited(SectionKind::Scales, at, value.to_bits()), scales);
        }
    }
    for (at, value) in [(3, 9), (4, 7), (4, 17), (5, 0), (9, 1 << 31), (10, 0), (46, f32::NAN.to_bits())] {
        assert_eq!(edited(SectionKind::Scales, at, value), scales, "word {at} is {value}");
    }
    let last = Parts::integers(SHAPE).section(SectionKind::Output).len() - 1;
    let bad = edited(SectionKind::Output, last, f32::NAN.to_bits());
    assert_eq!(bad, ImageError::NotFinite(SectionKind::Output));
}

#[test]
fn an_integer_section_of_the_wrong_length_is_named() {
    for kind in &SectionKind::ALL[5..12] {
        let mut longer = Parts::integers(SHAPE);
        longer.section(*kind).push(1);
        assert_eq!(longer.fault(), ImageError::Section(*kind));
        let mut shorter = Parts::integers(SHAPE);
        shorter.section(*kind).pop();
        assert_eq!(shorter.fault(), ImageError::Section(*kind));
    }
}

#[test]
fn a_sum_of_more_terms_than_fit_is_refused_by_the_shape() {
    let wide = Parts::integers(SHAPE);
    for shape in
        [Shape { state: 513, ..SHAPE }, Shape { hidden: 513, ..SHAPE }, Shape { kappa_embedding: 513, ..SHAPE }]
    {
        let mut parts = wide.clone();
        parts.manifest.shape = shape;
        *parts.section(SectionKind::StateNormaliser) = vec![0; 2 * usize::from(shape.state)];
        *parts.section(SectionKind::Kappa3) = vec![0; 5 * usize::from(shape.kappa_embedding)];
        assert_eq!(parts.fault_within(32768), ImageError::Shape);
    }
}
