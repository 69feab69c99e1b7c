//! Rosenbrock methods: steps of high order that solve linear equations only. They know numbers and no rod.
//!
//! For an implicit system of second order, G(θ, θ', θ'', t) = 0 with θ' = ν and ν' = β, read as a differential-algebraic
//! system of index 1 in (θ, ν; β), stage i of a step h from (θ₀, ν₀, β₀) solves
//!
//! ```text
//! (G_θ + w G_ν + w² G_β) x = −G(θᵢ, νᵢ, βᵢ, t₀ + cᵢ h) − dᵢ h G_t + G_ν p + G_β (w p + q)          w = 1/(γ h)
//! p = νᵢ + Σ Cᵢⱼ Uⱼ^θ / h          q = βᵢ + Σ Cᵢⱼ Uⱼ^ν / h          (θ, ν, β)ᵢ = (θ, ν, β)₀ + Σ aᵢⱼ Uⱼ
//! Uᵢ = (x, w x − p, w (w x − p) − q)
//! ```
//!
//! with all derivatives taken once, at the beginning of the step; G_ν p and G_β (w p + q) are what the iterates of a
//! Newton method would bring. The last stage is the step's error estimate, the step ends at y_s + U_s and is
//! continuous, to the order of the estimate, as
//!
//! ```text
//! y(t₀ + ϑ h) = (1−ϑ) y₀ + ϑ (y₁ + (1−ϑ) (k₁ + ϑ (k₂ + ϑ k₃)))          k_m = Σ H_mj Uⱼ
//! ```
//!
//! All are L-stable and stiffly accurate: what is too stiff to be followed rests, whatever the step. Source: E. Hairer,
//! G. Wanner: Solving Ordinary Differential Equations II, Springer 1996, sections IV.7 and VI.4.

/// Most stages of a method.
pub const MAX_STAGES: usize = 8;

/// The coefficients of a method, in the transformed form that needs no product with a matrix.
#[derive(Debug, PartialEq)]
pub struct Rosenbrock {
    /// s.
    pub stages: usize,
    /// Order of the step; that of the estimate is one less.
    pub order: u32,
    /// γ.
    pub gamma: f64,
    /// a; its last row but for the one of U_s is the step.
    pub a: &'static [&'static [f64]],
    /// C.
    pub c: &'static [&'static [f64]],
    /// c: where in the step the stages stand.
    pub nodes: &'static [f64],
    /// d: the weights of the derivative by time.
    pub rates: &'static [f64],
    /// H, of the continuous extension.
    pub dense: &'static [&'static [f64]],
}

impl Rosenbrock {
    /// Coefficients of U₁ … U_s in y(t₀ + ϑ h) − y₀, ϑ ∈ [0, 1].
    pub fn extension(&self, theta: f64) -> [f64; MAX_STAGES] {
        let mut weights = [0.0; MAX_STAGES];
        let last = self.a[self.stages - 1];
        for j in 0..self.stages {
            let step = last.get(j).copied().unwrap_or(1.0);
            let bend = self.dense.iter().rev().fold(0.0, |sum, row| sum * theta + row[j]);
            weights[j] = theta * (step + (1.0 - theta) * bend);
        }
        weights
    }
}

/// RODAS of Hairer and Wanner, order 4 with an estimate of order 3 (table 4.2 of section VI.4 there).
pub const RODAS4: Rosenbrock = Rosenbrock {
    stages: 6,
    order: 4,
    gamma: 0.25,
    a: &[
        &[],
        &[1.544],
        &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
        &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
        &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
        &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895, 1.0],
    ],
    c: &[
        &[],
        &[-5.6688],
        &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
        &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
        &[7.496_443_313_967_647, -10.246_804_314_643_52, -33.999_903_528_199_05, 11.708_908_932_061_6],
        &[
            8.083_246_795_921_522,
            -7.981_132_988_064_893,
            -31.521_594_328_743_71,
            16.319_305_431_231_36,
            -6.058_818_238_834_054,
        ],
    ],
    nodes: &[0.0, 0.386, 0.21, 0.63, 1.0, 1.0],
    rates: &[0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0],
    dense: &[
        &[
            10.126_235_083_445_86,
            -7.487_995_877_610_167,
            -34.800_918_615_557_47,
            -7.992_771_707_568_823,
            1.025_137_723_295_662,
            0.0,
        ],
        &[
            -0.676_280_339_280_125_3,
            6.087_714_651_680_015,
            16.430_843_208_924_78,
            24.767_225_114_183_86,
            -6.594_389_125_716_872,
            0.0,
        ],
    ],
};

/// Rodas5P, order 5 with an estimate of order 4: G. Steinebach: Construction of Rosenbrock-Wanner method Rodas5P and
/// numerical benchmarks within the Julia Differential Equations package, BIT Numerical Mathematics 63, 2023.
pub const RODAS5P: Rosenbrock = Rosenbrock {
    stages: 8,
    order: 5,
    gamma: 0.211_937_563_194_290_14,
    a: &[
        &[],
        &[3.0],
        &[2.849_394_379_747_939, 0.458_422_422_044_639_23],
        &[-6.954_028_509_809_101, 2.489_845_061_869_568, -10.358_996_098_473_584],
        &[2.802_998_627_562_896_4, 0.507_246_473_622_820_6, -0.398_831_254_177_052_4, -0.047_211_872_304_046_41],
        &[
            -7.502_846_399_306_121,
            2.561_846_144_803_919,
            -11.627_539_656_261_098,
            -0.182_687_676_599_422_56,
            0.030_198_172_008_377_946,
        ],
        &[
            -7.502_846_399_306_121,
            2.561_846_144_803_919,
            -11.627_539_656_261_098,
            -0.182_687_676_599_422_56,
            0.030_198_172_008_377_946,
            1.0,
        ],
        &[
            -7.502_846_399_306_121,
            2.561_846_144_803_919,
            -11.627_539_656_261_098,
            -0.182_687_676_599_422_56,
            0.030_198_172_008_377_946,
            1.0,
            1.0,
        ],
    ],
    c: &[
        &[],
        &[-14.155_112_264_123_755],
        &[-17.972_960_358_859_52, -2.859_693_295_451_294],
        &[147.121_502_757_117_16, -1.412_214_027_182_13, 71.689_402_513_023_58],
        &[165.435_170_248_716_76, -0.459_282_345_649_112_6, 42.909_383_369_586_03, -5.961_986_721_573_306],
        &[
            24.854_864_614_690_072,
            -3.000_922_700_283_218_6,
            47.493_111_002_076_8,
            5.581_419_782_155_812_5,
            -0.661_069_182_524_947_1,
        ],
        &[
            30.912_732_140_285_99,
            -3.120_824_334_993_797_4,
            77.799_546_460_708_92,
            34.286_460_282_947_83,
            -19.097_331_116_725_623,
            -28.087_943_162_872_662,
        ],
        &[
            37.802_771_233_905_63,
            -3.257_196_902_907_227_6,
            112.269_188_494_963_27,
            66.934_723_124_404_7,
            -40.066_189_370_910_02,
            -54.667_802_628_779_68,
            -9.488_616_523_096_27,
        ],
    ],
    nodes: &[
        0.0,
        0.635_812_689_582_870_4,
        0.409_579_839_339_753_5,
        0.976_930_672_506_071_6,
        0.428_840_360_955_866_4,
        1.0,
        1.0,
        1.0,
    ],
    rates: &[
        0.211_937_563_194_290_14,
        -0.423_875_126_388_580_27,
        -0.338_462_712_623_592_4,
        1.804_645_287_288_273_4,
        2.325_825_639_765_069,
        0.0,
        0.0,
        0.0,
    ],
    dense: &[
        &[
            25.948_786_856_663_858,
            -2.557_972_484_584_623_5,
            10.433_815_404_888_879,
            -2.367_925_102_268_520_4,
            0.524_948_541_321_073,
            1.124_108_831_045_040_4,
            0.427_287_619_443_187_4,
            -0.172_022_210_701_554_93,
        ],
        &[
            -9.915_688_506_951_71,
            -0.968_994_459_411_515_6,
            3.043_803_724_297_845_3,
            -24.495_224_566_215_796,
            20.176_138_334_709_044,
            15.980_663_614_246_51,
            -6.789_040_303_419_874,
            -6.710_236_069_923_372,
        ],
        &[
            11.419_903_575_922_262,
            2.887_964_514_613_699_4,
            72.921_379_959_960_29,
            80.125_118_346_226_43,
            -52.072_871_366_152_654,
            -59.789_936_252_667_29,
            -0.155_826_842_827_519_13,
            4.883_087_185_713_722,
        ],
    ],
};
