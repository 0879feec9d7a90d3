//! Runs the core on pairs from a file, on an emulated board, and says what each stage makes and costs.
//!
//! Each pair in the smallest of the firmware's memories that takes pictures of its size.
//!
//! `stages PAIRS`: for each pair six numbers (i32, little endian) and two grey pictures, the left one first:
//! width, height, focal length (1/256 px), offset of disparities (1/256 px), median filter and so on as the
//! device has them (1) or all that the core can (0), and 0. Prints a line a stage: the number of the pair,
//! eye, stage, CRC-32 of the product, instructions; and `done` at the end.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use firmware::board::mps2::{Board, Timer, argument};
    use firmware::memory::{Capacities, Qvga, Small, Storage, Vga};
    use firmware::stages::Stages;
    use semihosting::fs::File;
    use semihosting::io::Read;
    use semihosting::{println, process};
    use shared::bitmap::{Grey, Size};
    use shared::pipeline::{Memory, Settings, run, scratch_words};
    use shared::stage::depth::Optics;
    use shared::stage::sequential_thinning::scratch_order;
    use static_cell::ConstStaticCell;

    const LARGEST: Capacities = Vga::CAPACITIES;
    /// Thinning by distance has a list of the object's pixels, which may fill the core's limit of 60 %.
    const ORDER: usize = scratch_order(LARGEST.size.pixels() * 6 / 10, u16::MAX >> 2);
    const SCRATCH: usize = scratch_words(LARGEST.size, LARGEST.points, LARGEST.controls, ORDER);

    static SMALL: ConstStaticCell<Small> = ConstStaticCell::new(Small::new());
    static QVGA: ConstStaticCell<Qvga> = ConstStaticCell::new(Qvga::new());
    static VGA: ConstStaticCell<Vga> = ConstStaticCell::new(Vga::new());
    static ALL_SCRATCH: ConstStaticCell<[u64; SCRATCH]> = ConstStaticCell::new([0; SCRATCH]);
    static PICTURES: ConstStaticCell<[[u8; LARGEST.size.pixels()]; 2]> =
        ConstStaticCell::new([[0; LARGEST.size.pixels()]; 2]);

    /// What stands before a pair's pictures.
    struct Header {
        size: Size,
        optics: Optics,
        as_device: bool,
    }

    /// The next pair's, unless the file has ended.
    fn header(file: &mut File) -> Option<Header> {
        let mut bytes = [0; 24];
        if file.read(&mut bytes).expect("the file can be read") == 0 {
            return None;
        }
        let (numbers, _) = bytes.as_chunks::<4>();
        let [width, height, focal, disparity_offset, as_device, 0] =
            [0, 1, 2, 3, 4, 5].map(|i: usize| i32::from_le_bytes(numbers[i]))
        else {
            panic!("this is no header of a pair");
        };
        let size = Size::new(width as usize, height as usize).expect("a size");
        Some(Header { size, optics: Optics { focal, disparity_offset }, as_device: as_device == 1 })
    }

    fn settings(header: &Header) -> Settings {
        if header.as_device { Settings::device(header.optics) } else { Settings::new(header.optics) }
    }

    fn observe(
        number: usize,
        memory: &mut Memory<'_>,
        [left, right]: [Grey<'_>; 2],
        header: &Header,
        timer: &Timer,
    ) {
        let mut stages = Stages::new(timer, |record| println!("{number} {record} {}", record.cost));
        let outcome = run(memory, left, right, &settings(header), &mut stages);
        stages.ended(&outcome, memory.eyes[0].samples);
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let timer = Board::take().expect("taken once").timer;
        let mut file = argument();

        let (small, qvga, vga) = (SMALL.take(), QVGA.take(), VGA.take());
        let (scratch, pictures) = (ALL_SCRATCH.take(), PICTURES.take());
        let mut number = 0;
        while let Some(header) = header(&mut file) {
            let size = header.size;
            for picture in pictures.iter_mut() {
                file.read_exact(&mut picture[..size.pixels()]).expect("a whole picture");
            }
            let pair = pictures.each_ref().map(|bytes| Grey::new(size, size.width, bytes).expect("checked"));
            let fits = |c: Capacities| size.width <= c.size.width && size.height <= c.size.height;
            let mut memory = if fits(Small::CAPACITIES) {
                small.lend()
            } else if fits(Qvga::CAPACITIES) {
                qvga.lend()
            } else {
                vga.lend()
            };
            if !header.as_device {
                memory.scratch = scratch;
            }
            observe(number, &mut memory, pair, &header, &timer);
            number += 1;
        }
        println!("done");
        process::exit(0)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on an emulated board: see firmware/README.md");
}
