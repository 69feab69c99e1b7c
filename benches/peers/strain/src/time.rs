//! Classical Runge-Kutta of order four with a fixed step.

/// An ordinary differential equation y' = f(t, y).
pub trait Motion {
    /// The start.
    fn start(&self) -> Vec<f64>;
    /// y' into `rates`.
    fn rates(&mut self, t: f64, y: &[f64], rates: &mut [f64]);
    /// Tip position, m, and the force of the rod on its base, N.
    fn sample(&mut self, t: f64, y: &[f64]) -> ([f64; 3], [f64; 3]);
}

/// The storage of the steps.
pub struct RungeKutta {
    rates: [Vec<f64>; 2],
    stage: Vec<f64>,
}

impl RungeKutta {
    /// For y of this size.
    pub fn new(size: usize) -> Self {
        Self { rates: [vec![0.0; size], vec![0.0; size]], stage: vec![0.0; size] }
    }

    /// One step of `dt`.
    pub fn step(&mut self, motion: &mut dyn Motion, t: f64, y: &mut [f64], dt: f64) {
        let Self { rates: [rate, sum], stage } = self;
        motion.rates(t, y, rate);
        for i in 0..y.len() {
            sum[i] = rate[i];
            stage[i] = rate[i].mul_add(0.5 * dt, y[i]);
        }
        for half in [0.5 * dt, dt] {
            motion.rates(t + 0.5 * dt, stage, rate);
            for i in 0..y.len() {
                sum[i] = rate[i].mul_add(2.0, sum[i]);
                stage[i] = rate[i].mul_add(half, y[i]);
            }
        }
        motion.rates(t + dt, stage, rate);
        for i in 0..y.len() {
            y[i] = (rate[i] + sum[i]).mul_add(dt / 6.0, y[i]);
        }
    }
}
