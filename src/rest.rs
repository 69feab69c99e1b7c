//! The shape of the unstressed rod: pieces of constant curvature and twist, one after another from base to tip.
//!
//! A piece is straight, an arc or a helix; what bends otherwise is as many of them as it takes. They are given by parts of
//! the length and by turns, so that a longer rod has the same shape, only larger. No cell reaches over the end of a piece:
//! within a cell the rest curvature is constant, and a kink of it costs no order.

use crate::archive::{Archive, Archived, Corrupt, archived};
use crate::mesh::{Cell, Gauss, Mesh};
use nalgebra::Vector3;
use std::fmt;

/// Most pieces; each is at least a cell.
pub const MAX_PIECES: usize = 1000;

/// Rounding of the sum of so many parts.
const ROUNDING: f64 = 1e-9;

/// A piece of the unstressed rod.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Piece {
    /// Its part of the rod's length.
    pub part: f64,
    /// Its curvature and twist times its length, body frame, rad; its rotation vector, as far as that reaches.
    pub turn: Vector3<f64>,
}

archived!(Piece { part, turn });

impl Piece {
    const STRAIGHT: Self = Self { part: 1.0, turn: Vector3::new(0.0, 0.0, 0.0) };

    /// This piece and one that goes on with the same curvature as one.
    fn joined(&self, next: &Self) -> Option<Self> {
        let same = self.turn * next.part == next.turn * self.part;
        same.then(|| Self { part: self.part + next.part, turn: self.turn + next.turn })
    }
}

/// Why pieces are no rest shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Invalid {
    /// There are too many.
    TooMany {
        /// How many.
        given: usize,
    },
    /// A number is not allowed.
    Number {
        /// Of which piece, counted from 1.
        piece: usize,
        /// What it is.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// The parts do not make up the rod.
    Sum {
        /// What they make up.
        sum: f64,
    },
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany { given } => write!(f, "a rest shape of {given} pieces is not allowed: up to {MAX_PIECES}"),
            Self::Number { piece, what, value } => {
                let allowed = if *what == "part" { "> 0" } else { "finite" };
                write!(f, "piece {piece} of the rest shape: {what} = {value} is not allowed: {allowed}")
            }
            Self::Sum { sum } => write!(f, "the parts of the rest shape add up to {sum}, not to 1"),
        }
    }
}

impl std::error::Error for Invalid {}

/// All pieces of a rod; of a straight one by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RestShape {
    /// None for a straight rod.
    pieces: Vec<Piece>,
}

impl RestShape {
    /// From base to tip. Pieces that go on alike become one.
    ///
    /// # Errors
    /// [`Invalid`]
    pub fn new(pieces: &[Piece]) -> Result<Self, Invalid> {
        for (k, Piece { part, turn }) in pieces.iter().enumerate() {
            let invalid = |what, value: f64| Err(Invalid::Number { piece: k + 1, what, value });
            if !(*part > 0.0 && part.is_finite()) {
                return invalid("part", *part);
            }
            if let Some(value) = turn.iter().find(|value| !value.is_finite()) {
                return invalid("turn", *value);
            }
        }
        let sum: f64 = pieces.iter().map(|piece| piece.part).sum();
        if !pieces.is_empty() && (sum - 1.0).abs() > ROUNDING {
            return Err(Invalid::Sum { sum });
        }
        let mut joined: Vec<Piece> = Vec::with_capacity(pieces.len());
        for piece in pieces {
            match joined.last_mut().and_then(|last| Some((last.joined(piece)?, last))) {
                Some((both, last)) => *last = both,
                None => joined.push(*piece),
            }
        }
        match joined.as_slice() {
            [one] if one.turn == Vector3::zeros() => joined.clear(),
            // exactly, however the parts of a single arc add up
            [one] => joined = vec![Piece { part: 1.0, ..*one }],
            _ => {}
        }
        if joined.len() > MAX_PIECES {
            Err(Invalid::TooMany { given: joined.len() })
        } else {
            Ok(Self { pieces: joined })
        }
    }

    /// Its pieces, one at least.
    pub fn pieces(&self) -> &[Piece] {
        if self.pieces.is_empty() { &[Piece::STRAIGHT] } else { &self.pieces }
    }

    /// Of each piece of a rod of this length, with `more` added to its curvature: the turn from end to end, rad.
    fn turns(&self, length: f64, more: &Vector3<f64>) -> impl Iterator<Item = f64> {
        self.pieces().iter().map(move |Piece { part, turn }| (turn + more * (length * part)).norm())
    }

    /// Turn of all pieces, as of [`Self::mesh`], rad.
    pub fn turn(&self, length: f64, more: &Vector3<f64>) -> f64 {
        self.turns(length, more).sum()
    }

    /// The rod of `length` m with `more` 1/m added to its curvature everywhere, in `count` cells of as equal lengths as the
    /// pieces allow: in one for each piece, if those are more, and in as many as it takes that none turns by more than
    /// `most_turn` rad.
    pub fn mesh(&self, length: f64, more: &Vector3<f64>, count: usize, most_turn: f64, stages: usize) -> Mesh {
        let mut cells = Vec::with_capacity(count.max(self.pieces().len()));
        let pieces = self.pieces().iter().zip(self.turns(length, more)).zip(self.counts(count));
        for ((Piece { part, turn }, angle), count) in pieces {
            let count = count.max((angle / most_turn).ceil() as usize);
            let own = length * part;
            let cell = Cell { length: own / count as f64, kappa_rest: more + turn / own };
            cells.resize(cells.len() + count, cell);
        }
        Mesh { cells, rule: Gauss::new(stages) }
    }

    /// How many of `count` cells each piece gets.
    fn counts(&self, count: usize) -> Vec<usize> {
        let pieces = self.pieces();
        let mut counts: Vec<usize> =
            pieces.iter().map(|piece| ((piece.part * count as f64) as usize).clamp(1, count.max(1))).collect();
        let mut sum: usize = counts.iter().sum();
        let wanted = count.max(pieces.len());
        // rounding has cost the pieces less than a cell each, or given them one
        while sum != wanted {
            let cell = |k: usize, count: usize| pieces[k].part / count as f64;
            let longest = (0..pieces.len()).max_by(|&a, &b| cell(a, counts[a]).total_cmp(&cell(b, counts[b])));
            let several = (0..pieces.len()).filter(|&k| counts[k] > 1);
            let shortest = several.min_by(|&a, &b| cell(a, counts[a] - 1).total_cmp(&cell(b, counts[b] - 1)));
            match (longest, shortest) {
                (Some(k), _) if sum < wanted => (counts[k], sum) = (counts[k] + 1, sum + 1),
                (_, Some(k)) if sum > wanted => (counts[k], sum) = (counts[k] - 1, sum - 1),
                _ => break,
            }
        }
        counts
    }
}

/// What is loaded is as good as what was made.
impl Archived for RestShape {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        self.pieces.visit(archive)?;
        if archive.is_loading() {
            *self = Self::new(&self.pieces).map_err(|invalid| Corrupt::Refused { why: invalid.to_string() })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive;

    type Vec3 = Vector3<f64>;

    fn bent(part: f64, turn: f64) -> Piece {
        Piece { part, turn: Vec3::y() * turn }
    }

    #[test]
    fn what_goes_on_alike_is_one_piece() {
        let straight = RestShape::new(&[bent(0.2, 0.0), bent(0.3, 0.0), bent(0.5, 0.0)]).unwrap();
        assert_eq!(straight, RestShape::default());
        let arc = RestShape::new(&[bent(0.25, 0.5), bent(0.75, 1.5)]).unwrap();
        assert_eq!(arc.pieces(), [bent(1.0, 2.0)]);
        assert_eq!(RestShape::new(&[bent(0.5, 0.5), bent(0.5, 1.5)]).unwrap().pieces().len(), 2);
    }

    #[test]
    fn what_is_no_shape_is_refused() {
        let why = |pieces: &[Piece]| RestShape::new(pieces).unwrap_err().to_string();
        assert_eq!(why(&[bent(0.5, 0.0), bent(0.0, 0.0)]), "piece 2 of the rest shape: part = 0 is not allowed: > 0");
        assert_eq!(why(&[bent(1.0, f64::NAN)]), "piece 1 of the rest shape: turn = NaN is not allowed: finite");
        assert_eq!(why(&[bent(0.5, 0.0)]), "the parts of the rest shape add up to 0.5, not to 1");
        let many: Vec<Piece> = (0..1024).map(|k| bent(1.0 / 1024.0, f64::from(k))).collect();
        assert_eq!(why(&many), "a rest shape of 1024 pieces is not allowed: up to 1000");
        // nor is it loaded
        let (mut bytes, mut wrong) = (Vec::new(), RestShape { pieces: vec![bent(0.5, 0.0)] });
        archive::save(&mut wrong, &mut bytes);
        let refused = Corrupt::Refused { why: Invalid::Sum { sum: 0.5 }.to_string() };
        assert_eq!(archive::load(&mut RestShape::default(), &bytes), Err(refused));
    }

    #[test]
    fn cells_end_with_the_pieces_and_are_as_equal_as_they_allow() {
        let shape = RestShape::new(&[bent(0.5, 0.0), bent(0.1, 6.0), bent(0.4, 1.0)]).unwrap();
        for (count, expected) in [(0, [1, 1, 1]), (3, [1, 1, 1]), (4, [2, 1, 1]), (5, [2, 1, 2]), (20, [10, 2, 8])] {
            assert_eq!(shape.counts(count), expected, "{count}");
        }
        assert_eq!(RestShape::default().counts(7), [7]);
        let mesh = shape.mesh(2.0, &Vec3::z(), 3, 2.5, 4);
        let ends: Vec<f64> = mesh.cells.iter().map(|cell| cell.length).collect();
        // the middle one turns by 6 rad, and with the twist a little more
        assert_eq!(ends, [1.0, 0.2 / 3.0, 0.2 / 3.0, 0.2 / 3.0, 0.8]);
        assert_eq!(mesh.cells[1].kappa_rest, Vec3::new(0.0, 30.0, 1.0));
        assert!((shape.turn(2.0, &Vec3::z()) - (1.0 + 36.04f64.sqrt() + 1.64f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn a_straight_rod_has_the_cells_of_a_uniform_one() {
        let kappa = Vec3::new(0.1, 0.2, 0.3);
        assert_eq!(RestShape::default().mesh(0.7, &kappa, 3, 2.5, 2), Mesh::uniform(0.7, 3, 2, kappa));
    }
}
