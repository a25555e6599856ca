//! The elementary functions that exported C has with it give the bits of the core.

use math::Real;
use std::fmt::Write;
use std::process::Command;

const HEADER: &str = include_str!("../src/export/elementary.h");

/// Name, function, least and greatest argument.
type Tested = (&'static str, fn(f64) -> f64, [f64; 2]);
const FUNCTIONS: [Tested; 5] = [
    ("exp", Real::exp, [-760.0, 720.0]),
    ("ln", Real::ln, [-1.0, 50.0]),
    ("sin", Real::sin, [-1e3, 1e3]),
    ("cos", Real::cos, [-1e3, 1e3]),
    ("tanh", Real::tanh, [-25.0, 25.0]),
];
const SPECIAL: [f64; 7] = [0.0, -0.0, 1.0, 1e-310, f64::MAX, f64::INFINITY, f64::NEG_INFINITY];

#[test]
fn elementary_functions_in_c_have_the_bits_of_the_core() {
    let mut state = 1_u64;
    let mut random = |[low, high]: [f64; 2]| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut code = String::from("#include \"pneudrive_math.h\"\nint main(void)\n{\n    int wrong = 0;\n");
    let mut check = |call: String, value: f64| {
        let expected = if value.is_nan() { "x != x".into() } else { format!("{:#x}", value.to_bits()) };
        let _ = if value.is_nan() {
            writeln!(code, "    {{ double x = {call}; wrong += !({expected}); }}")
        } else {
            writeln!(code, "    wrong += pneudrive_bits({call}) != UINT64_C({expected});")
        };
    };
    let number = |x: f64| format!("pneudrive_number(UINT64_C({:#x}))", x.to_bits());
    for (name, function, range) in FUNCTIONS {
        let own: Vec<f64> = SPECIAL.into_iter().chain((0..300).map(|_| random(range))).collect();
        own.iter().for_each(|&x| check(format!("pneudrive_{name}({})", number(x)), function(x)));
    }
    for _ in 0..300 {
        let (x, y) = (random([0.0, 20.0]), random([-5.0, 5.0]));
        check(format!("pneudrive_pow({}, {})", number(x), number(y)), Real::pow(x, y));
    }
    for k in 0..600 {
        let (x, y) = (random([-9.0, 9.0]), random([-9.0, 9.0]));
        // A sum that nearly cancels, one far below the product, one far above it, and tiny numbers.
        let (scale, z) = [(1.0, -x * y), (1.0, 1e-17 * x), (1.0, 1e16 * x), (1e-160, 1e-310)][k % 4];
        let (x, y) = (scale * x, scale * y);
        check(format!("pneudrive_fma({}, {}, {})", number(x), number(y), number(z)), x.mul_add(y, z));
    }
    code += "    return wrong > 255 ? 255 : wrong;\n}\n";
    let folder = std::env::temp_dir().join(format!("pneudrive-c-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("pneudrive_math.h"), HEADER).expect("a header");
    std::fs::write(folder.join("main.c"), code).expect("a program");
    let program = folder.join("main");
    for fma in ["-UPNEUDRIVE_SOFTWARE_FMA", "-DPNEUDRIVE_SOFTWARE_FMA"] {
        let compiled = Command::new("cc")
            .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O1", fma, "-o"])
            .args([&program, &folder.join("main.c")])
            .arg("-lm")
            .status()
            .expect("a C compiler");
        assert!(compiled.success());
        let wrong = Command::new(&program).status().expect("it runs");
        assert_eq!(wrong.code(), Some(0), "so many values differ with {fma}");
    }
    std::fs::remove_dir_all(&folder).expect("it was made here");
}
