//! Decimal numbers as OBJ files have them, to the nearest f64.

/// Powers of ten that f64 holds exactly.
const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Digits that always fit 64 bits.
const MAX_DIGITS: usize = 19;

/// The number in `word`, correctly rounded. What programs write for a number that is none, such as
/// `nan`, `-inf` or `1.#IND`, is not finite; `None` for everything else that is no number.
pub(super) fn decimal(word: &[u8]) -> Option<f64> {
    short_decimal(word).or_else(|| {
        let text = std::str::from_utf8(word).ok()?;
        let is_none = || text.contains(".#") || text.trim_start_matches('-').starts_with("nan(");
        text.parse().ok().or_else(|| is_none().then_some(f64::NAN))
    })
}

/// As [`decimal`] where digits and power of ten are both exact in f64, so that one operation rounds
/// once (Clinger, "How to Read Floating Point Numbers Accurately", 1990). That is the common case, and
/// half as dear as the general one.
fn short_decimal(word: &[u8]) -> Option<f64> {
    let (is_negative, unsigned) = match word {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, word),
    };
    let mut digits = 0_u64;
    let mut count = 0;
    let mut point = None;
    let mut exponent = 0;
    for (index, &byte) in unsigned.iter().enumerate() {
        match byte {
            b'0'..=b'9' => {
                digits = digits.wrapping_mul(10).wrapping_add(u64::from(byte - b'0'));
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            b'e' | b'E' => {
                exponent = short_integer(&unsigned[index + 1..])?;
                break;
            }
            _ => return None,
        }
    }
    if count == 0 || count > MAX_DIGITS || digits > 1 << 53 {
        return None;
    }
    let fraction_digits = point.map_or(0, |point| count - point);
    exponent -= fraction_digits as i64;
    let power = *EXACT_POWERS.get(usize::try_from(exponent.unsigned_abs()).ok()?)?;
    let digits = digits as f64;
    let value = if exponent < 0 {
        digits / power
    } else {
        digits * power
    };
    Some(if is_negative { -value } else { value })
}

/// The integer in `word`, if it is one within 64 bits.
pub(super) fn integer(word: &[u8]) -> Option<i64> {
    short_integer(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
}

/// As [`integer`] for up to 18 digits, which cannot overflow.
fn short_integer(word: &[u8]) -> Option<i64> {
    let (is_negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0;
    for &byte in digits {
        if !byte.is_ascii_digit() {
            return None;
        }
        value = 10 * value + i64::from(byte - b'0');
    }
    Some(if is_negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::{ProptestConfig, any, prop_assert_eq, proptest};
    use proptest::test_runner::RngSeed;

    use super::*;

    #[test]
    fn every_way_to_write_a_number_is_read_like_the_standard_library_does() {
        for text in [
            "0",
            "-0",
            "1",
            "+1.5",
            ".5",
            "5.",
            "-.7e+2",
            ".8e-001",
            "1E5",
            "148376.123456790",
            "9007199254740993",
            "0.1",
            "1e22",
            "1e23",
            "1e-22",
            "1e-23",
            "123456789012345678901234567890",
            "0.00000000000000000000000012345",
            "1e400",
            "inf",
            "-inf",
            "4.9e-324",
        ] {
            let expected: f64 = text.parse().unwrap();
            let read = decimal(text.as_bytes()).expect(text);
            assert_eq!(read.to_bits(), expected.to_bits(), "{text}");
        }
    }

    #[test]
    fn what_is_not_a_number_is_told_from_what_is_no_word_for_one() {
        for text in ["nan", "-nan", "1.#IND", "-1.#INF", "1.#QNAN", "-nan(ind)"] {
            let read = decimal(text.as_bytes()).expect(text);
            assert!(!read.is_finite(), "{text}");
        }
        for text in ["", "x", ".", "-", "e5", "1e", "1.2.3", "0x10", "1,5", "--1"] {
            assert_eq!(decimal(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn integers_are_read_to_the_limits_of_64_bits() {
        for value in [0, 1, -1, 123, i64::MAX, i64::MIN] {
            assert_eq!(integer(value.to_string().as_bytes()), Some(value));
        }
        assert_eq!(integer(b"+7"), Some(7));
        for text in ["", "-", "+", "1.0", "9223372036854775808", "1x"] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn printed_numbers_are_read_back_bit_for_bit(bits in any::<u64>(), places in 0_usize..18) {
            let value = f64::from_bits(bits);
            if value.is_finite() {
                let text = format!("{value:e}");
                prop_assert_eq!(decimal(text.as_bytes()).map(f64::to_bits), Some(bits));
                let small = value % 1e6;
                let text = format!("{small:.places$}");
                prop_assert_eq!(decimal(text.as_bytes()), text.parse::<f64>().ok());
            }
        }
    }
}
