//! What attribute kernels are specialized for, and where the parts of a voxel's state and row are.

use std::fmt::Write;

use trixel::attributes::{AttributeKind as Kind, AttributeRequest, Combine};

/// A request as kernels see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Recipe {
    combine: Combine,
    /// One bit for each of [`Kind::ALL`].
    kinds: u16,
    priorities: bool,
}

impl Recipe {
    pub(crate) fn of(request: &AttributeRequest) -> Self {
        let kinds = Kind::ALL.iter().enumerate().filter(|(_, kind)| request.kinds().contains(kind));
        let combine = request.combine();
        Self {
            combine,
            kinds: kinds.fold(0, |bits, (i, _)| bits | 1 << i),
            priorities: request.has_priorities() && combine != Combine::All,
        }
    }

    pub(crate) fn combine(self) -> Combine {
        self.combine
    }

    /// Whether materials have priorities that count.
    pub(crate) fn priorities(self) -> bool {
        self.priorities
    }

    fn has(self, kind: Kind) -> bool {
        Kind::ALL.iter().position(|one| *one == kind).is_some_and(|i| self.kinds >> i & 1 == 1)
    }

    /// Words of a row.
    pub(crate) fn row_words(self) -> u32 {
        Kind::ALL.into_iter().filter(|kind| self.has(*kind)).map(Kind::device_words).sum()
    }

    /// Words of a voxel's state.
    pub(crate) fn state_words(self) -> u32 {
        self.sums().1
    }

    /// The sums and where they begin, and the words of all.
    fn sums(self) -> (Vec<(&'static str, u32)>, u32) {
        // Sums are of 64 bits, maxima of 32.
        let words = match self.combine {
            Combine::Mean | Combine::AreaWeighted => 2,
            Combine::Max => 1,
            Combine::Nearest | Combine::Dominant | Combine::First | Combine::All => 0,
        };
        let parts = [
            ("WEIGHT", 1, self.combine == Combine::AreaWeighted),
            ("COLOR", 4, self.has(Kind::Color)),
            ("NORMAL", 3, self.has(Kind::Normal)),
            ("GEOMETRIC_NORMAL", 3, self.has(Kind::GeometricNormal)),
            ("EMISSION", 3, self.has(Kind::Emission)),
            ("METALLIC_ROUGHNESS", 2, self.has(Kind::MetallicRoughness)),
        ];
        let mut at = 4;
        let sums = parts.map(|(name, components, there)| {
            let start = at;
            at += if there { components * words } else { 0 };
            (name, start)
        });
        (sums.to_vec(), at)
    }

    /// The constants in front of the kernels.
    pub(crate) fn constants(self) -> String {
        let Some(combine) = Combine::ALL.iter().position(|one| *one == self.combine) else { return String::new() };
        let (sums, state_words) = self.sums();
        let (row_words, priorities) = (self.row_words(), self.priorities);
        let mut text = format!(
            "const COMBINE: u32 = {combine}u;\nconst PRIORITIES: bool = {priorities};\n\
             const STATE_WORDS: u32 = {state_words}u;\nconst ROW_WORDS: u32 = {row_words}u;\n"
        );
        for (name, at) in sums {
            let _ = writeln!(text, "const SUM_{name}: u32 = {at}u;");
        }
        let mut at = 0;
        for kind in Kind::ALL {
            let (name, there) = (kind.name().to_uppercase(), self.has(kind));
            let _ = writeln!(text, "const WANT_{name}: bool = {there};\nconst ROW_{name}: u32 = {at}u;");
            at += if there { kind.device_words() } else { 0 };
        }
        text
    }

    /// Some of all shapes, for tests of the sources.
    #[cfg(test)]
    pub(crate) fn samples() -> Vec<Self> {
        let all = Combine::ALL.map(|combine| Self { combine, kinds: 0x1ff, priorities: combine != Combine::All });
        let few =
            [Combine::Mean, Combine::Max, Combine::All].map(|combine| Self { combine, kinds: 3, priorities: false });
        all.into_iter().chain(few).collect()
    }
}
