//! States that are saved and freed take no memory: by themselves, as what other tests allocate would count.
#![cfg(target_os = "linux")]
#![allow(missing_docs)]

use cosserat_rod::fmi2::host::Fmu;
use cosserat_rod::package;
use std::{fs, ptr};

/// Of the process, bytes.
fn resident() -> usize {
    let text = fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<usize>().unwrap() * 4096
}

#[test]
fn states_that_are_freed_take_no_memory() {
    let fmu = Fmu::from_library(&package::library().unwrap()).unwrap();
    let slave = fmu.instantiate("rod", false).unwrap();
    slave.setup_experiment(0.0, Some(1.0), None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    slave.do_step(0.0, 0.1).unwrap();
    let mut size = 0;
    let mut again = |times: usize| {
        for _ in 0..times {
            let mut handle = ptr::null_mut();
            slave.get_state(&mut handle).unwrap();
            slave.set_state(handle).unwrap();
            size = slave.serialize(handle).unwrap().len();
            slave.free_state(&mut handle).unwrap();
        }
    };
    again(1000);
    let before = resident();
    again(10_000);
    let grown = resident().saturating_sub(before);
    // what an allocator may take for itself is a hundredth of what states that are kept would
    assert!(size > 2000 && grown < 100 * size, "{grown} bytes, states of {size}");
}
