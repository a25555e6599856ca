//! Private functions of `processor.rs`.

use super::{NEEDED, lacking, missing};

#[test]
fn a_processor_that_lacks_one_set_is_found_out_by_its_name() {
    assert_eq!(missing(|_| [u32::MAX; 4]), None);
    for (name, number, register, bit) in NEEDED {
        let mut registers = [u32::MAX; 4];
        registers[register] &= !(1 << bit);
        assert_eq!(missing(|own| if own == number { registers } else { [u32::MAX; 4] }), Some(name));
    }
    assert_eq!(lacking(), None, "these tests run on the processor that they are compiled for");
}
