//! Thumb-2, as far as it takes to follow the flow of control and the depth of the stack: ARMv7-M Architecture
//! Reference Manual, A5 and A7.7.

/// What an instruction does to flow and stack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Neither.
    None,
    /// The stack grows by so many bytes, or shrinks.
    Stack(i32),
    /// Something is called, and comes back.
    Call(u32),
    /// The same, by an address in a register.
    CallRegister,
    /// It goes on elsewhere; also here, where that depends.
    Jump(u32, bool),
    /// It goes on elsewhere, by an address in a register that is not the one of returns.
    JumpRegister,
    /// It goes on at one of the halves of distances that follow, of so many bytes each.
    Table(usize),
    /// It ends here: a return, or what is no instruction.
    End,
    /// The next so many instructions depend on a condition.
    If(u32),
    /// The stack moves by what only a register knows.
    Unknown,
}

const SP: u32 = 13;
const LR: u32 = 14;
const PC: u32 = 15;

/// The instruction at an address, whose bytes begin `code`: its effect and its length.
///
/// # Panics
/// When there are fewer bytes than it has.
pub fn decode(address: u32, code: &[u8]) -> (Effect, u32) {
    let half = |i: usize| u32::from(u16::from_le_bytes([code[2 * i], code[2 * i + 1]]));
    let first = half(0);
    if first >> 11 < 0b11101 { (short(address, first), 2) } else { (long(address, first, half(1)), 4) }
}

/// `value` of so many bits, with its sign.
const fn signed(value: u32, bits: u32) -> u32 {
    ((value << (32 - bits)).cast_signed() >> (32 - bits)).cast_unsigned()
}

fn short(address: u32, code: u32) -> Effect {
    let words = |list: u32| 4 * list.count_ones().cast_signed();
    let ahead = |distance: u32| address.wrapping_add(4).wrapping_add(distance);
    // Of moves and sums with any register.
    let (to, from) = (code >> 4 & 8 | code & 7, code >> 3 & 15);
    match code >> 8 {
        0x44 | 0x46 if to == SP => Effect::Unknown,
        0x44 | 0x46 if to == PC => Effect::JumpRegister,
        0x47 if code & 0x80 != 0 => Effect::CallRegister,
        0x47 if from == LR => Effect::End,
        0x47 => Effect::JumpRegister,
        0xB0 if code & 0x80 != 0 => Effect::Stack(4 * (code & 0x7F).cast_signed()),
        0xB0 => Effect::Stack(-4 * (code & 0x7F).cast_signed()),
        0xB4 | 0xB5 => Effect::Stack(words(code & 0x1FF)),
        0xBD => Effect::End,
        0xBC => Effect::Stack(-words(code & 0xFF)),
        0xB1 | 0xB3 | 0xB9 | 0xBB => Effect::Jump(ahead(code >> 3 & 0x40 | code >> 2 & 0x3E), true),
        0xBF if code & 15 != 0 => Effect::If(4 - (code & 15).trailing_zeros()),
        0xDE => Effect::End,
        0xD0..0xDE => Effect::Jump(ahead(signed(code << 1 & 0x1FF, 9)), true),
        0xE0..0xE8 => Effect::Jump(ahead(signed(code << 1 & 0xFFF, 12)), false),
        _ => Effect::None,
    }
}

fn long(address: u32, first: u32, second: u32) -> Effect {
    let ahead = |distance: u32| address.wrapping_add(4).wrapping_add(distance);
    let words = |list: u32| 4 * list.count_ones().cast_signed();
    let to = second >> 8 & 15;
    if first >> 11 == 0b11110 && second >> 15 == 1 {
        // Branches. A sign, and two bits that tell with it how far.
        let [sign, one, two] = [first >> 10 & 1, second >> 13 & 1, second >> 11 & 1];
        let [one_far, two_far] = [one, two].map(|bit| 1 ^ bit ^ sign);
        let far = sign << 24 | one_far << 23 | two_far << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
        let near = sign << 20 | two << 19 | one << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1;
        return match second >> 12 & 0b101 {
            0b101 => Effect::Call(ahead(signed(far, 25))),
            0b001 => Effect::Jump(ahead(signed(far, 25)), false),
            // Barriers and special registers have a place of their own among conditions; UDF.W is there, too.
            0b000 if first >> 7 & 7 != 7 => Effect::Jump(ahead(signed(near, 21)), true),
            0b000 if first >> 4 == 0xF7F && second >> 12 == 0b1010 => Effect::End,
            _ => Effect::None,
        };
    }
    match first {
        // Many registers, two, and one, with the pointer moved on.
        0xE92D => Effect::Stack(words(second)),
        0xE8BD if second >> PC & 1 == 1 => Effect::End,
        0xE8BD => Effect::Stack(-words(second)),
        0xE96D => Effect::Stack(4 * (second & 0xFF).cast_signed()),
        0xE8FD => Effect::Stack(-4 * (second & 0xFF).cast_signed()),
        0xF84D if second >> 8 & 15 == 0b1101 => Effect::Stack((second & 0xFF).cast_signed()),
        0xF85D if second >> 8 & 15 == 0b1011 && second >> 12 == PC => Effect::End,
        0xF85D if second >> 8 & 15 == 0b1011 => Effect::Stack(-(second & 0xFF).cast_signed()),
        // Registers of floating point.
        0xED2D | 0xED6D => Effect::Stack(4 * (second & 0xFF).cast_signed()),
        0xECBD | 0xECFD => Effect::Stack(-4 * (second & 0xFF).cast_signed()),
        // A difference and a sum, constants coded and plain.
        0xF1AD | 0xF5AD if to == SP => Effect::Stack(constant(first, second).cast_signed()),
        0xF10D | 0xF50D if to == SP => Effect::Stack(-constant(first, second).cast_signed()),
        0xF2AD | 0xF6AD if to == SP => Effect::Stack(plain(first, second).cast_signed()),
        0xF20D | 0xF60D if to == SP => Effect::Stack(-plain(first, second).cast_signed()),
        0xE8DF if second & 0xFFE0 == 0xF000 => Effect::Table(1 + (second >> 4 & 1) as usize),
        // A table that lies elsewhere.
        0xE8D0..=0xE8DE if second & 0xFFE0 == 0xF000 => Effect::JumpRegister,
        // Whatever else computes the stack pointer, or loads what runs next.
        _ if first >> 9 == 0b1110101 && to == SP && second >> 15 == 0 => Effect::Unknown,
        _ if first >> 11 == 0b11110 && second >> 15 == 0 && to == SP && first >> 4 & 1 == 0 => {
            Effect::Unknown
        }
        _ if first & 0xFF70 == 0xF850 && second >> 12 == PC => Effect::JumpRegister,
        _ if first & 0xFF70 == 0xF850 && second >> 12 == SP => Effect::Unknown,
        _ => Effect::None,
    }
}

/// The twelve bits of a constant.
const fn plain(first: u32, second: u32) -> u32 {
    first << 1 & 0x800 | second >> 4 & 0x700 | second & 0xFF
}

/// What they stand for: a byte, repeated or shifted.
const fn constant(first: u32, second: u32) -> u32 {
    let (bits, byte) = (plain(first, second), second & 0xFF);
    match bits >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (byte & 0x7F | 0x80).rotate_right(bits >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As an assembler writes them.
    #[test]
    fn instructions_that_matter_are_told_from_others() {
        let cases: [(&[u16], Effect); 26] = [
            (&[0xB5F0], Effect::Stack(20)),                   // push {r4-r7, lr}
            (&[0xBDF0], Effect::End),                         // pop {r4-r7, pc}
            (&[0xB083], Effect::Stack(12)),                   // sub sp, #12
            (&[0xB003], Effect::Stack(-12)),                  // add sp, #12
            (&[0xE92D, 0x4FF0], Effect::Stack(36)),           // push.w {r4-r11, lr}
            (&[0xF84D, 0xBD04], Effect::Stack(4)),            // str r11, [sp, #-4]!
            (&[0xF85D, 0xBB04], Effect::Stack(-4)),           // ldr r11, [sp], #4
            (&[0xF5AD, 0x5D80], Effect::Stack(4096)),         // sub.w sp, sp, #4096
            (&[0xF6AD, 0x5D24], Effect::Stack(0xD24)),        // subw sp, sp, #3364
            (&[0xED2D, 0x8B04], Effect::Stack(16)),           // vpush {d8, d9}
            (&[0x4770], Effect::End),                         // bx lr
            (&[0x4718], Effect::JumpRegister),                // bx r3
            (&[0x4798], Effect::CallRegister),                // blx r3
            (&[0xF7FF, 0xFFFE], Effect::Call(0x1000)),        // bl 0x1000
            (&[0xF000, 0xB802], Effect::Jump(0x1008, false)), // b.w 0x1008
            (&[0xF43F, 0xAFFE], Effect::Jump(0x1000, true)),  // beq.w 0x1000
            (&[0xD0FE], Effect::Jump(0x1000, true)),          // beq 0x1000
            (&[0xE7FE], Effect::Jump(0x1000, false)),         // b 0x1000
            (&[0xB110], Effect::Jump(0x1008, true)),          // cbz r0, 0x1008
            (&[0xE8DF, 0xF001], Effect::Table(1)),            // tbb [pc, r1]
            (&[0xE8D2, 0xF001], Effect::JumpRegister),        // tbb [r2, r1]
            (&[0xBF18], Effect::If(1)),                       // it ne
            (&[0x466F], Effect::None),                        // mov r7, sp
            (&[0x46BD], Effect::Unknown),                     // mov sp, r7
            (&[0xDE00], Effect::End),                         // udf #0
            (&[0xF7F0, 0xA000], Effect::End),                 // udf.w #0
        ];
        for (halves, effect) in cases {
            let bytes: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
            assert_eq!(decode(0x1000, &bytes), (effect, bytes.len() as u32), "{halves:04X?}");
        }
    }
}
