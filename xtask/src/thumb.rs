//! As much of the Thumb-2 instruction set as a call graph needs.
//!
//! What it is: the length of an instruction, where it may branch to, and what it takes of the stack.
//! What can go wrong: an indirect branch is told as such; its targets are not known.
//! Units: bytes, addresses.
//! Reference: ARMv7-M Architecture Reference Manual, sections A5.2-A5.3 and A7.7 (B, BL, BLX, BX, CBZ, PUSH, VPUSH, SUB).

/// What an instruction does to the flow and the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Nothing of interest.
    Plain,
    /// A call or a jump to an address.
    To(u32),
    /// A call or a jump to an address in a register.
    Indirect,
    /// Takes bytes of the stack.
    Push(u32),
}

/// Sign-extends the lowest `bits` of `value`.
fn signed(value: u32, bits: u32) -> i32 {
    ((value << (32 - bits)) as i32) >> (32 - bits)
}

/// A modified immediate constant (A5.3.2).
fn expand(imm12: u32) -> u32 {
    let byte = imm12 & 0xff;
    match imm12 >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | (imm12 & 0x7f)).rotate_right(imm12 >> 7),
    }
}

/// Length and effect of the instruction whose first two halfwords are given, at `at`.
pub(crate) fn decode(at: u32, first: u16, second: u16) -> (u32, Effect) {
    let (a, b) = (u32::from(first), u32::from(second));
    let relative = |offset: i32| Effect::To(at.wrapping_add(4).wrapping_add_signed(offset));
    if a >> 11 < 0b11101 {
        let effect = match a {
            _ if a & 0xf000 == 0xd000 && a & 0x0e00 != 0x0e00 => relative(signed(a & 0xff, 8) * 2),
            _ if a & 0xf800 == 0xe000 => relative(signed(a & 0x7ff, 11) * 2),
            _ if a & 0xf500 == 0xb100 => relative((((a >> 9 & 1) << 5 | a >> 3 & 0x1f) * 2) as i32),
            _ if a & 0xff87 == 0x4780 => Effect::Indirect,
            _ if a & 0xff87 == 0x4700 && a != 0x4770 => Effect::Indirect,
            _ if a & 0xfe00 == 0xb400 => Effect::Push((a & 0x1ff).count_ones() * 4),
            _ if a & 0xff80 == 0xb080 => Effect::Push((a & 0x7f) * 4),
            _ => Effect::Plain,
        };
        return (2, effect);
    }
    let imm12 = (a >> 10 & 1) << 11 | (b >> 12 & 7) << 8 | b & 0xff;
    let effect = if a & 0xf800 == 0xf000 && b & 0x8000 != 0 {
        let (s, j1, j2) = (a >> 10 & 1, b >> 13 & 1, b >> 11 & 1);
        match b & 0xd000 {
            0xd000 | 0x9000 => {
                let (i1, i2) = (1 ^ j1 ^ s, 1 ^ j2 ^ s);
                relative(signed(s << 24 | i1 << 23 | i2 << 22 | (a & 0x3ff) << 12 | (b & 0x7ff) << 1, 25))
            }
            0x8000 if a >> 7 & 7 != 7 => {
                relative(signed(s << 20 | j2 << 19 | j1 << 18 | (a & 0x3f) << 12 | (b & 0x7ff) << 1, 21))
            }
            _ => Effect::Plain,
        }
    } else if a == 0xe92d {
        Effect::Push(b.count_ones() * 4)
    } else if a == 0xf84d && b & 0x0f00 == 0x0d00 {
        Effect::Push(b & 0xff)
    } else if a & 0xffbf == 0xed2d {
        Effect::Push((b & 0xff) * 4)
    } else if a & 0xfbef == 0xf1ad && b & 0x0f00 == 0x0d00 {
        Effect::Push(expand(imm12))
    } else if a & 0xfbef == 0xf2ad && b & 0x0f00 == 0x0d00 {
        Effect::Push(imm12)
    } else if a & 0xff70 == 0xf850 && b & 0xf000 == 0xf000 {
        Effect::Indirect // a load into the program counter
    } else {
        Effect::Plain
    };
    (4, effect)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings from an assembler.
    #[test]
    fn what_an_assembler_says() {
        for (at, first, second, wanted) in [
            (0x100, 0xf000, 0xf801, (4, Effect::To(0x106))),           // bl +2
            (0x800_1000, 0xf7ff, 0xfffe, (4, Effect::To(0x800_1000))), // bl to itself
            (0x100, 0xf000, 0xb801, (4, Effect::To(0x106))),           // b.w +2
            (0x100, 0xf43f, 0xaffe, (4, Effect::To(0x100))),           // beq.w to itself
            (0x100, 0xe7fe, 0, (2, Effect::To(0x100))),                // b to itself
            (0x100, 0xd0fe, 0, (2, Effect::To(0x100))),                // beq to itself
            (0x100, 0xdf01, 0, (2, Effect::Plain)),                    // svc 1
            (0x100, 0xde01, 0, (2, Effect::Plain)),                    // udf 1
            (0x100, 0xb108, 0, (2, Effect::To(0x106))),                // cbz r0, +2
            (0x100, 0x4798, 0, (2, Effect::Indirect)),                 // blx r3
            (0x100, 0x4770, 0, (2, Effect::Plain)),                    // bx lr
            (0x100, 0x4718, 0, (2, Effect::Indirect)),                 // bx r3
            (0x100, 0xb5f0, 0, (2, Effect::Push(20))),                 // push {r4-r7, lr}
            (0x100, 0xb084, 0, (2, Effect::Push(16))),                 // sub sp, #16
            (0x100, 0xe92d, 0x4ff0, (4, Effect::Push(36))),            // push.w {r4-r11, lr}
            (0x100, 0xf84d, 0xbd04, (4, Effect::Push(4))),             // str r11, [sp, #-4]!
            (0x100, 0xed2d, 0x8b02, (4, Effect::Push(8))),             // vpush {d8}
            (0x100, 0xf5ad, 0x7d00, (4, Effect::Push(512))),           // sub.w sp, sp, #512
            (0x100, 0xf2ad, 0x4d04, (4, Effect::Push(0x404))),         // subw sp, sp, #1028
            (0x100, 0xf3bf, 0x8f5f, (4, Effect::Plain)),               // dmb sy
        ] {
            assert_eq!(decode(at, first, second), wanted, "{first:#06x} {second:#06x}");
        }
    }
}
