//! The last step as it was gone through, for another time with other inputs.

use super::{Acting, Error, Last, Outputs, Parameters, Unit};
use crate::integrator::Course;

/// The outputs as functions of what acts, in the last communication step as it was gone through or, before the first, at
/// the start: number, order and length of the internal steps and cells are settled.
#[derive(Clone, Debug)]
pub struct Response<'a> {
    pub(super) unit: &'a Unit,
    /// Of a step; there is none of a start.
    pub(super) course: Option<(Course, &'a Last)>,
}

impl Response<'_> {
    /// What acted.
    pub fn acting(&self) -> Acting {
        match &self.course {
            Some((_, last)) => last.acting.clone(),
            None => Acting::held(&self.unit.start.inputs, self.unit.start.parameters.tunable()),
        }
    }

    /// Whether it would be all in a plane, had this acted.
    pub fn stays_in_plane(&self, acting: &Acting) -> bool {
        self.course.as_ref().is_some_and(|(course, Last { paths, duration, .. })| {
            course.stays_in_plane(&acting.along(&paths.segments(acting, *duration)))
        })
    }

    /// The outputs, had this acted, in a plane only if it [would be](Self::stays_in_plane). What counts the work done is as
    /// it was.
    ///
    /// # Errors
    /// [`Error`] as of [`Unit::new`] and [`Unit::advance`].
    pub fn to(&self, acting: &Acting, in_plane: bool) -> Result<Outputs, Error> {
        let Unit { start, outputs, .. } = self.unit;
        let damping = acting.tunable.damped(start.parameters.rod());
        let (mut rod, end) = match &self.course {
            Some((course, Last { paths, duration, acting: held })) => {
                let segments = paths.segments(acting, *duration);
                let other = (acting.tunable != held.tunable).then_some(&damping);
                let rod = course.under(&acting.along(&segments), other, in_plane);
                let rod = rod.map_err(|failed| self.unit.failure(failed, &segments))?;
                (rod, acting.along(&segments)(*duration).boundary)
            }
            None => {
                let boundary = acting.at(&start.paths(&acting.inputs));
                let Parameters { start_in_equilibrium, quasi_static, .. } = start.parameters;
                let mut begin = self.unit.integrator.clone();
                begin.take_damping(&damping);
                let time = start.parameters.time(&damping);
                let rod = begin.restarted(&boundary, start_in_equilibrium || quasi_static, time);
                (rod.map_err(Error::NoStart)?, boundary)
            }
        };
        let mut outputs = outputs.clone();
        let Outputs { solver, cells, .. } = outputs;
        outputs.read(&mut rod, &end, &start.parameters);
        Ok(Outputs { solver, cells, ..outputs })
    }

    /// Of the rod.
    pub fn parameters(&self) -> &Parameters {
        &self.unit.start.parameters
    }

    /// Length of the communication step, s; none at the start.
    pub fn duration(&self) -> Option<f64> {
        self.course.as_ref().map(|(_, last)| last.duration)
    }
}
