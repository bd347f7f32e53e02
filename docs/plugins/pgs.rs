//! Projected Gauss-Seidel sweeps with relaxation, for all laws: the solver SORprox(relaxation=...) in Rust.
//!
//! rustc -O --crate-type cdylib pgs.rs -o libpgs.so
//! proxbench run --solver "Shared(./libpgs.so, options='relaxation=1.5')"
use std::ffi::{c_char, c_void, CStr};
use std::slice::from_raw_parts;
use std::time::Instant;

const SOLVED: i32 = 0;
const ITERATION_LIMIT: i32 = 1;
const TIME_LIMIT: i32 = 2;
const OSCILLATING: i32 = 4;
const DIVERGED: i32 = 5;
const INFEASIBLE: i32 = 6;
const UNSUPPORTED: i32 = 7;
const HALF_LINE: i32 = 0;
const BALL: i32 = 2;
const SCALES_AND_SPARSE: u32 = 1 | 4;

#[repr(C)]
pub struct Description {
    interface_version: u32, size: u32,
    name: *const c_char, version: *const c_char,
    model: i32, sides: i32,
    forms: u32, laws: u32, flags: u32, reserved: u32,
}
unsafe impl Sync for Description {}

#[repr(C)]
pub struct Problem { // the first fields of pb_problem, which this solver reads
    size: u32, forms: u32,
    n_rows: i64, n_laws: i64, n_dofs: i64, n_blocks: i64, width: i64, infeasible_law: i64,
    free_velocity: *const f64,
    set: *const i32, row_count: *const i32, first_row: *const i32,
    friction: *const f64, fixed_bound: *const f64,
    partner: *const i32,
    alpha: *const f64, weight: *const f64,
    dense: *const f64,
    row_starts: *const i32, columns: *const i32,
    values: *const f64, diagonal: *const f64,
}

#[repr(C)]
pub struct Request {
    size: u32, threads: u32,
    tolerance: f64, max_iterations: i64, max_seconds: f64,
    start: *const f64,
    observe: Option<extern "C" fn(*mut c_void, i64, *const f64)>,
    context: *mut c_void,
}

#[repr(C)]
pub struct Answer { size: u32, reserved: u32, impulses: *mut f64, iterations: i64, message: *const c_char }

pub struct Law { set: i32, first: usize, count: usize, friction: f64, fixed: f64, partner: i32, alpha: f64, weight: f64, step: f64 }

pub struct Solver { laws: Vec<Law>, c: Vec<f64>, diagonal: Vec<f64>, starts: Vec<usize>, columns: Vec<usize>, values: Vec<f64>, infeasible: bool }

impl Solver {
    unsafe fn new(p: &Problem, relaxation: f64) -> Solver {
        let (n, m) = (p.n_rows as usize, p.n_laws as usize);
        let starts: Vec<usize> = from_raw_parts(p.row_starts, n + 1).iter().map(|&k| k as usize).collect();
        let columns: Vec<usize> = from_raw_parts(p.columns, starts[n]).iter().map(|&k| k as usize).collect();
        let values = from_raw_parts(p.values, starts[n]).to_vec();
        let diagonal = from_raw_parts(p.diagonal, n).to_vec();
        let law = |i: usize| {
            let (first, count) = (*p.first_row.add(i) as usize, *p.row_count.add(i) as usize);
            let largest = diagonal[first..first + count].iter().fold(0.0, |a: f64, &b| a.max(b));
            Law {
                set: *p.set.add(i), first, count, friction: *p.friction.add(i), fixed: *p.fixed_bound.add(i),
                partner: *p.partner.add(i), alpha: *p.alpha.add(i), weight: *p.weight.add(i),
                step: if largest > 0.0 { relaxation / largest } else { 0.0 },
            }
        };
        let laws = (0..m).map(law).collect();
        let c = from_raw_parts(p.free_velocity, n).to_vec();
        Solver { laws, c, diagonal, starts, columns, values, infeasible: p.infeasible_law >= 0 }
    }

    fn velocity(&self, x: &[f64], row: usize) -> f64 {
        (self.starts[row]..self.starts[row + 1]).fold(self.c[row], |sum, k| sum + self.values[k] * x[self.columns[k]])
    }

    fn radius(&self, x: &[f64], law: &Law) -> f64 {
        let normal = if law.partner < 0 { 0.0 } else { x[self.laws[law.partner as usize].first].max(0.0) };
        law.fixed + law.friction * normal
    }

    fn sweep(&self, x: &mut [f64]) {
        for law in &self.laws {
            let (mut moved, mut squared, bound) = ([0.0; 3], 0.0, self.radius(x, law));
            for k in 0..law.count {
                moved[k] = x[law.first + k] - law.step * self.velocity(x, law.first + k);
                squared += moved[k] * moved[k];
            }
            let scale = if law.set == BALL && squared > bound * bound { bound / squared.sqrt() } else { 1.0 };
            for k in 0..law.count {
                x[law.first + k] = if law.set == HALF_LINE { moved[k].max(0.0) } else { scale * moved[k] };
            }
        }
    }

    /// Return the residual, or its rounding error if that is larger; see PB_SCALES in proxbench.h.
    fn residual(&self, x: &[f64]) -> f64 {
        let (mut largest, mut hidden) = (0.0f64, 0.0f64);
        for law in &self.laws {
            let (mut held, mut v, bound) = ([0.0; 3], [0.0; 3], law.alpha * self.radius(x, law));
            for k in 0..law.count {
                held[k] = law.alpha * x[law.first + k];
                v[k] = self.velocity(x, law.first + k);
                hidden = hidden.max(law.weight * (self.diagonal[law.first + k] * x[law.first + k]).abs());
            }
            let outside: f64 = (0..3).map(|k| (held[k] - v[k]).powi(2)).sum();
            let squared: f64 = match law.set {
                HALF_LINE => held[0].min(v[0]).powi(2),
                BALL if outside > bound * bound => {
                    (0..3).map(|k| (held[k] - bound / outside.sqrt() * (held[k] - v[k])).powi(2)).sum()
                }
                _ => v.iter().map(|one| one * one).sum(),
            };
            let one = law.weight * squared.sqrt();
            if !(one <= largest) { largest = one }
        }
        if largest.is_nan() { f64::INFINITY } else { largest.max(2.2e-14 * hidden) }
    }
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

#[no_mangle]
pub extern "C" fn proxbench_describe() -> *const Description {
    static ABOUT: Description = Description {
        interface_version: 1, size: std::mem::size_of::<Description>() as u32,
        name: b"pgs-rust\0".as_ptr() as *const c_char, version: b"1.0\0".as_ptr() as *const c_char,
        model: 0, sides: 0, forms: SCALES_AND_SPARSE, laws: 127, flags: 1, reserved: 0,
    };
    &ABOUT
}

/// # Safety
/// Proxbench calls this function and the two below with the structures of proxbench.h.
#[no_mangle]
pub unsafe extern "C" fn proxbench_prepare(
    problem: *const Problem, options: *const c_char, prepared: *mut *mut Solver, message: *mut *const c_char,
) -> i32 {
    let text = CStr::from_ptr(options).to_str().unwrap_or("?");
    let given = if text.is_empty() { Ok(1.0) } else { text.trim_start_matches("relaxation=").parse::<f64>() };
    match given {
        Ok(relaxation) if relaxation > 0.0 => {
            *prepared = Box::into_raw(Box::new(Solver::new(&*problem, relaxation)));
            SOLVED
        }
        _ => {
            *message = b"write options='relaxation=1.5', a positive number\0".as_ptr() as *const c_char;
            UNSUPPORTED
        }
    }
}

#[no_mangle]
pub unsafe extern "C" fn proxbench_solve(prepared: *mut Solver, request: *const Request, answer: *mut Answer) -> i32 {
    let (s, request, answer, began) = (&*prepared, &*request, &mut *answer, Instant::now());
    let n = s.c.len();
    let mut x = from_raw_parts(request.start, n).to_vec();
    let (mut best, mut old, mut older) = (x.clone(), x.clone(), x.clone());
    let (mut lowest, mut first, mut done) = (f64::INFINITY, 1.0, 0i64);
    let status = loop {
        if s.infeasible { best.fill(0.0); break INFEASIBLE }
        let found = s.residual(&x);
        if done == 0 { first = found.max(1.0) }
        if found < lowest { lowest = found; best.copy_from_slice(&x) }
        if found <= request.tolerance { break SOLVED }
        if !(found < 1e8 * first) { break DIVERGED }
        let rounding = 3.6e-15 * x.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        if done > 2 && distance(&x, &older) <= rounding && distance(&x, &old) > rounding { break OSCILLATING }
        if done >= request.max_iterations { break ITERATION_LIMIT }
        if began.elapsed().as_secs_f64() > request.max_seconds { break TIME_LIMIT }
        let next = (done + 10.min(1 + done / 2)).min(request.max_iterations);
        while done < next {
            std::mem::swap(&mut older, &mut old);
            old.copy_from_slice(&x);
            s.sweep(&mut x);
            done += 1;
            if let Some(observe) = request.observe { observe(request.context, done, x.as_ptr()) }
        }
    };
    std::ptr::copy_nonoverlapping(best.as_ptr(), answer.impulses, n);
    answer.iterations = done;
    status
}

#[no_mangle]
pub unsafe extern "C" fn proxbench_free(prepared: *mut Solver) {
    drop(Box::from_raw(prepared));
}
