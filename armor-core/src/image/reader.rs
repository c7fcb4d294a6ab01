//! Takes an image's sections apart, each once, in their order.

use super::manifest::{Manifest, SectionKind};
use super::sections::Dense;
use super::{ImageError, SECTION_ALIGNMENT};
use crate::budget_map::BudgetMap;

/// Takes the sections from the body, one after the other.
pub(super) struct Reader<'m, 'a> {
    manifest: &'m Manifest<'m>,
    body: &'a [u8],
    /// Index of the next section in the table.
    next: usize,
    /// Where the last section ended.
    end: usize,
}

impl<'m, 'a> Reader<'m, 'a> {
    /// A reader at the first section.
    pub(super) const fn new(manifest: &'m Manifest<'m>, body: &'a [u8]) -> Self {
        Self { manifest, body, next: 0, end: 0 }
    }

    /// The words of the next section, which must be `kind` and, where given, hold `count` words.
    pub(super) fn words(&mut self, kind: SectionKind, count: Option<usize>) -> Result<&'a [u32], ImageError> {
        let error = ImageError::Section(kind);
        let section = self.manifest.sections.get(self.next).ok_or(error)?;
        let (offset, length) = (section.offset as usize, section.length as usize);
        if section.kind != kind || offset != self.end.next_multiple_of(SECTION_ALIGNMENT) {
            return Err(error);
        }
        if count.is_some_and(|count| length != 4 * count) {
            return Err(error);
        }
        let padding = self.body.get(self.end..offset).ok_or(error)?;
        let bytes = self.body.get(offset..).and_then(|rest| rest.get(..length)).ok_or(error)?;
        if padding.iter().any(|&byte| byte != 0) {
            return Err(error);
        }
        self.next += 1;
        self.end = offset + length;
        bytemuck::try_cast_slice(bytes).map_err(|_| error)
    }

    pub(super) fn floats(&mut self, kind: SectionKind, count: usize) -> Result<&'a [f32], ImageError> {
        let words = self.words(kind, Some(count))?;
        let floats: &[f32] = bytemuck::try_cast_slice(words).map_err(|_| ImageError::Section(kind))?;
        if floats.iter().any(|value| !value.is_finite()) {
            return Err(ImageError::NotFinite(kind));
        }
        Ok(floats)
    }

    pub(super) fn pair(
        &mut self,
        kind: SectionKind,
        first: usize,
        second: usize,
    ) -> Result<(&'a [f32], &'a [f32]), ImageError> {
        self.floats(kind, first + second)?.split_at_checked(first).ok_or(ImageError::Section(kind))
    }

    pub(super) fn dense(&mut self, kind: SectionKind, inputs: usize, outputs: usize) -> Result<Dense<'a>, ImageError> {
        let (weights, bias) = self.pair(kind, inputs * outputs, outputs)?;
        Ok(Dense { weights, bias })
    }

    /// Whether the table names this section next.
    pub(super) fn is_next(&self, kind: SectionKind) -> bool {
        self.manifest.sections.get(self.next).is_some_and(|section| section.kind == kind)
    }

    /// The knots of the budget map, if the table names it.
    pub(super) fn budget_map(&mut self) -> Result<Option<BudgetMap<'a>>, ImageError> {
        if !self.is_next(SectionKind::BudgetMap) {
            return Ok(None);
        }
        match self.words(SectionKind::BudgetMap, None)?.as_chunks() {
            (knots, []) => BudgetMap::new(knots).map(Some).ok_or(ImageError::BudgetMap),
            _ => Err(ImageError::Section(SectionKind::BudgetMap)),
        }
    }

    /// The last section ends where the image ends, and no section follows it.
    pub(super) fn finish(&self) -> Result<(), ImageError> {
        if self.end == self.body.len() && self.next == self.manifest.sections.len() {
            Ok(())
        } else {
            Err(ImageError::Section(SectionKind::Golden))
        }
    }
}
