//! The figures of the gallery: the hexagonal room by every method and with every change that the
//! scene is made to show. A figure is the options of `wavepath render` that make it, nothing else.

/// Figures that are to be compared with one another.
#[derive(Debug)]
pub(super) struct Section {
    pub(super) title: &'static str,
    /// What to look for.
    pub(super) text: &'static str,
    pub(super) figures: &'static [Figure],
}

/// One picture of the hexagonal room.
#[derive(Debug)]
pub(super) struct Figure {
    /// Name of its files, without extension.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// What it shows.
    pub(super) text: &'static str,
    /// Pixels across and down.
    pub(super) side: u32,
    /// What of the room is seen.
    pub(super) view: View,
    /// Options of `wavepath render`.
    pub(super) options: &'static [&'static str],
}

/// A part of the image plane of the default camera.
#[derive(Debug, Clone, Copy)]
pub(super) enum View {
    /// All of it.
    Room,
    /// The glass sphere.
    Glass,
    /// The glass sphere and the floor below.
    GlassAndFloor,
    /// The tetrahedron.
    Tetrahedron,
    /// The matte sphere, which touches the floor.
    MatteSphere,
}

impl View {
    /// The values of the scene that show this part, for `--set`.
    pub(super) fn overrides(self) -> &'static [&'static str] {
        match self {
            Self::Room => &[],
            Self::Glass => &[
                "cameras.1.top_left=[0, 0.19, 0]",
                "cameras.1.right=[0, -0.5, 0]",
                "cameras.1.down=[0, 0, -0.5]",
            ],
            Self::GlassAndFloor => &[
                "cameras.1.top_left=[0, 0.4, 0]",
                "cameras.1.right=[0, -1, 0]",
                "cameras.1.down=[0, 0, -1]",
            ],
            Self::Tetrahedron => &[
                "cameras.1.top_left=[0, 0.68, -0.25]",
                "cameras.1.right=[0, -0.6, 0]",
                "cameras.1.down=[0, 0, -0.6]",
            ],
            Self::MatteSphere => &[
                "cameras.1.top_left=[0, 0, -0.12]",
                "cameras.1.right=[0, -0.6, 0]",
                "cameras.1.down=[0, 0, -0.6]",
            ],
        }
    }
}

/// All of the gallery, in order.
pub(super) const SECTIONS: &[Section] = &[
    Section {
        title: "Whitted's method and Monte Carlo",
        text: "Whitted's method sees direct light, mirrors and glass, and is done after one ray through the centre \
               of each pixel. Monte Carlo sees all light, and pays with noise, which halves with every four times \
               as many samples.",
        figures: &[
            Figure {
                name: "whitted",
                title: "Whitted",
                text: "Direct light alone: the ceiling, which faces no light, is black.",
                side: 400,
                view: View::Room,
                options: &["--integrator", "whitted", "--spp", "1"],
            },
            Figure {
                name: "1spp",
                title: "1 sample",
                text: "The colours bleed, the ceiling is lit.",
                side: 400,
                view: View::Room,
                options: &["--spp", "1"],
            },
            Figure {
                name: "100spp",
                title: "100 samples",
                text: "A tenth of the noise, but for the light that glass and mirrors throw.",
                side: 400,
                view: View::Room,
                options: &["--spp", "100"],
            },
            Figure {
                name: "400spp",
                title: "400 samples",
                text: "Half of that; caustics still glitter.",
                side: 400,
                view: View::Room,
                options: &["--spp", "400"],
            },
        ],
    },
    Section {
        title: "Supersampling",
        text: "One ray through the centre of a pixel sees one side of an edge; rays all over the pixel see how much of \
               it lies on either side. Few pixels, so that the stairs are seen.",
        figures: &[
            Figure {
                name: "supersampling-off",
                title: "Supersampling off",
                text: "64 rays through the centre of each pixel.",
                side: 100,
                view: View::Room,
                options: &["--integrator", "whitted", "--spp", "64"],
            },
            Figure {
                name: "supersampling-on",
                title: "Supersampling on",
                text: "64 rays through points all over each pixel.",
                side: 100,
                view: View::Room,
                options: &[
                    "--integrator",
                    "whitted",
                    "--spp",
                    "64",
                    "--supersampling",
                    "on",
                ],
            },
        ],
    },
    Section {
        title: "Refraction index",
        text: "The glass sphere turns the room upside down, the more so the denser it is.",
        figures: &[
            Figure {
                name: "ior-1.5",
                title: "Refraction index 1.5",
                text: "Crown glass.",
                side: 300,
                view: View::Glass,
                options: &["--spp", "256", "--set", "materials.glass.ior=1.5"],
            },
            Figure {
                name: "ior-1.75",
                title: "Refraction index 1.75",
                text: "Dense flint glass: it reflects more, too.",
                side: 300,
                view: View::Glass,
                options: &["--spp", "256", "--set", "materials.glass.ior=1.75"],
            },
        ],
    },
    Section {
        title: "Roughness",
        text: "The tetrahedron by Oren and Nayar's model. The rougher it is, the darker it looks from aside: facets \
               send light back to where it came from, and hide one another.",
        figures: &[
            Figure {
                name: "sigma-0",
                title: "σ = 0",
                text: "Lambert's law.",
                side: 300,
                view: View::Tetrahedron,
                options: &["--spp", "256", "--set", "materials.tetrahedron.sigma=0"],
            },
            Figure {
                name: "sigma-0.3",
                title: "σ = 0.3",
                text: "Slopes of 0.3 rad.",
                side: 300,
                view: View::Tetrahedron,
                options: &["--spp", "256", "--set", "materials.tetrahedron.sigma=0.3"],
            },
            Figure {
                name: "sigma-0.7",
                title: "σ = 0.7",
                text: "Slopes of 0.7 rad.",
                side: 300,
                view: View::Tetrahedron,
                options: &["--spp", "256", "--set", "materials.tetrahedron.sigma=0.7"],
            },
            Figure {
                name: "sigma-inf",
                title: "σ = ∞",
                text: "The roughest that the model has.",
                side: 300,
                view: View::Tetrahedron,
                options: &["--spp", "256", "--set", "materials.tetrahedron.sigma=inf"],
            },
        ],
    },
    Section {
        title: "Shadows and caustics of glass",
        text: "A shadow ray that glass stops makes a black shadow, one that goes straight through a pale one. What \
               light does is neither: the sphere gathers it into a caustic, which only a path that happens to run \
               from the floor through the glass into the light can find.",
        figures: &[
            Figure {
                name: "shadow-whitted",
                title: "Whitted, black shadow",
                text: "Glass stops shadow rays.",
                side: 300,
                view: View::GlassAndFloor,
                options: &["--integrator", "whitted", "--spp", "1"],
            },
            Figure {
                name: "shadow-whitted-transparent",
                title: "Whitted, transparent shadow",
                text: "Shadow rays go straight through, weighted by what glass transmits.",
                side: 300,
                view: View::GlassAndFloor,
                options: &[
                    "--integrator",
                    "whitted",
                    "--spp",
                    "1",
                    "--transparent-shadows",
                ],
            },
            Figure {
                name: "shadow-transparent",
                title: "Monte Carlo, transparent shadow",
                text: "Other light is there, and so is the bias: no caustic.",
                side: 300,
                view: View::GlassAndFloor,
                options: &["--spp", "256", "--transparent-shadows"],
            },
            Figure {
                name: "caustic",
                title: "Monte Carlo, caustic",
                text: "Unbiased. The mirror wall and the mirror sphere throw light, too.",
                side: 300,
                view: View::GlassAndFloor,
                options: &["--spp", "1024"],
            },
        ],
    },
    Section {
        title: "Where secondary rays start",
        text: "Rays that leave a surface start where rounding errors end, which is computed for each hit. A bias set \
               by hand, the same for all, is too small or too large: there is none that suits the whole room. The \
               matte sphere stands on the floor.",
        figures: &[
            Figure {
                name: "bias-0",
                title: "Bias 0",
                text: "Too small: about every second ray hits the surface that it leaves. Acne.",
                side: 300,
                view: View::MatteSphere,
                options: &["--spp", "256", "--shadow-bias", "0"],
            },
            Figure {
                name: "bias-computed",
                title: "Computed",
                text: "Outside of the error bound of each hit, some 10⁻⁶ m here.",
                side: 300,
                view: View::MatteSphere,
                options: &["--spp", "256"],
            },
            Figure {
                name: "bias-0.3",
                title: "Bias 0.3 m",
                text: "Too large: around the foot rays from the floor start within the sphere, in the dark; the bright \
                       spot under the glass moves.",
                side: 300,
                view: View::MatteSphere,
                options: &["--spp", "256", "--shadow-bias", "0.3"],
            },
            Figure {
                name: "bias-leak",
                title: "Bias 0.6 m, a sky outside",
                text: "The room is closed, but rays from the underside of the sphere start below the floor, and bring \
                       in the sky. With computed starts this is the second picture.",
                side: 300,
                view: View::MatteSphere,
                options: &[
                    "--spp",
                    "256",
                    "--shadow-bias",
                    "0.6",
                    "--set",
                    "background.radiance=[3, 3, 3]",
                ],
            },
        ],
    },
];
