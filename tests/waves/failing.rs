//! A writer that fails: the run goes on, and its error comes out at the end.

use crate::run::{run, units};
use ntmu::timing::heat::{HeatValue, MissMap};
use ntmu::timing::waves::{
    Konata, Perfetto, Ramulator, RamulatorFormat, Summary, Vcd, VcdTime, Window,
};
use std::io::{self, ErrorKind, Write};

/// Takes so many bytes, and no more.
#[derive(Debug)]
struct Full {
    room: usize,
    /// Calls after the one that failed.
    later: u32,
    has_failed: bool,
}

impl Full {
    fn new(room: usize) -> Full {
        Full {
            room,
            later: 0,
            has_failed: false,
        }
    }

    /// The error that came out is the writer's, and nothing was written after it.
    fn check(&self, found: io::Result<Summary>) {
        assert_eq!(found.unwrap_err().kind(), ErrorKind::StorageFull);
        assert!(self.has_failed);
        assert_eq!(self.later, 0);
    }
}

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.later += u32::from(self.has_failed);
        let taken = bytes.len().min(self.room);
        self.room -= taken;
        if taken == 0 {
            self.has_failed = true;
            return Err(ErrorKind::StorageFull.into());
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// In the first event, at the edges of the buffer, far into the file, and at its end.
fn rooms(length: usize) -> [usize; 6] {
    assert!(length > 8192, "longer than a buffer: {length}");
    [0, 1, 8191, 8192, length / 2, length - 1]
}

macro_rules! fails {
    ($test:ident, $writer:ident, $($argument:expr),*) => {
        #[test]
        fn $test() {
            for unit in units() {
                let alone = run(&unit, &mut ());
                let mut file = Vec::new();
                let mut watch = $writer::new(&mut file, &unit, $($argument),*);
                run(&unit, &mut watch);
                watch.finish().unwrap();
                for room in rooms(file.len()) {
                    let mut full = Full::new(room);
                    let mut watch = $writer::new(&mut full, &unit, $($argument),*);
                    assert_eq!(run(&unit, &mut watch), alone);
                    let finished = watch.finish();
                    full.check(finished);
                }
                let mut exact = Full::new(file.len());
                let mut watch = $writer::new(&mut exact, &unit, $($argument),*);
                run(&unit, &mut watch);
                watch.finish().unwrap();
                assert!(!exact.has_failed);
            }
        }
    };
}

fails!(a_dump_fails, Vcd, Window::ALL, VcdTime::Cycles);
fails!(a_trace_of_events_fails, Perfetto, Window::ALL);
fails!(a_pipeline_log_fails, Konata, Window::ALL);
fails!(
    a_memory_trace_fails,
    Ramulator,
    Window::ALL,
    RamulatorFormat::LoadStore,
    1
);

#[test]
fn a_picture_and_its_data_fail() {
    let mut map = MissMap::default();
    run(&units()[0], &mut map);
    for room in [0, 1, 64] {
        let png = map.write_png(Full::new(room), HeatValue::Misses);
        let csv = map.write_csv(Full::new(room));
        let json = map.write_json(Full::new(room));
        for result in [png, csv, json] {
            assert_eq!(result.unwrap_err().kind(), ErrorKind::StorageFull);
        }
    }
}
