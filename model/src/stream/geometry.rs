//! Geometry: what a screen's pixels see of a texture, in reals.
//!
//! Coordinates and gradients are f64; nothing here is specified to the bit. They become bits of f32
//! where a scene makes a [`SampleRequest`](ntmu_isa::sampler::SampleRequest) of them.

use std::ops::RangeInclusive;

/// What stands before the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// A texture that lies flat on the screen.
    Quad {
        /// Texels of mip 0 along a pixel: 1 is one to one, below it magnified, above it minified.
        scale: f64,
    },
    /// A floor without end, under a camera that looks along it.
    Plane {
        /// Of the camera above the floor.
        height: f64,
        /// How far the camera looks down, in degrees: at 90 straight at the floor.
        pitch: f64,
        /// Between the left and the right edge of the screen, in degrees.
        fov: f64,
        /// Of the texture on the floor, in units of the height; it repeats.
        size: f64,
    },
    /// A sphere of radius 1 in the middle of the screen, its texture by longitude and latitude.
    Sphere {
        /// From the camera to the middle of the sphere.
        distance: f64,
        /// Between the left and the right edge of the screen, in degrees.
        fov: f64,
        /// How often the texture goes round the sphere.
        repeat: f64,
    },
}

/// A number of a [`Geometry`].
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// As in text.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// The smallest and the largest that is allowed.
    pub allowed: RangeInclusive<f64>,
}

/// Lengths and ratios.
const POSITIVE: RangeInclusive<f64> = 1e-6..=1e6;
/// Angles of view, in degrees.
const FOV: RangeInclusive<f64> = 1.0..=170.0;

impl Geometry {
    /// The numbers, in the order of their text.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let list: &[(&'static str, f64, RangeInclusive<f64>)] = match *self {
            Geometry::Quad { scale } => &[("scale", scale, POSITIVE)],
            Geometry::Plane {
                height,
                pitch,
                fov,
                size,
            } => &[
                ("height", height, POSITIVE),
                ("pitch", pitch, -90.0..=90.0),
                ("fov", fov, FOV),
                ("size", size, POSITIVE),
            ],
            Geometry::Sphere {
                distance,
                fov,
                repeat,
            } => &[
                ("distance", distance, 1.001..=1e6),
                ("fov", fov, FOV),
                ("repeat", repeat, POSITIVE),
            ],
        };
        let parameter = |(name, value, allowed): &(&'static str, f64, _)| Parameter {
            name,
            value: *value,
            allowed: RangeInclusive::clone(allowed),
        };
        list.iter().map(parameter).collect()
    }

    /// The first number outside its range.
    #[must_use]
    pub fn refused(&self) -> Option<Parameter> {
        let mut parameters = self.parameters().into_iter();
        parameters.find(|p| !p.allowed.contains(&p.value))
    }
}

/// Where a pixel's centre lies on the texture, and how that changes from pixel to pixel: normalised
/// coordinates, with the exact derivatives at the centre (a GPU takes differences within a quad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub(super) uv: [f64; 2],
    /// d(u, v) / dx of the screen, in pixels.
    pub(super) dx: [f64; 2],
    /// d(u, v) / dy of the screen, in pixels.
    pub(super) dy: [f64; 2],
}

/// A geometry seen on a screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    geometry: Geometry,
    screen: [f64; 2],
    /// From one pixel to the next, on an image plane at distance 1.
    step: f64,
    /// Sine and cosine of the pitch.
    pitch: [f64; 2],
}

impl View {
    pub(super) fn new(geometry: Geometry, screen: [u32; 2]) -> View {
        let screen = screen.map(f64::from);
        let (fov, pitch) = match geometry {
            Geometry::Quad { .. } => (0.0, 0.0),
            Geometry::Plane { fov, pitch, .. } => (fov, pitch),
            Geometry::Sphere { fov, .. } => (fov, 0.0),
        };
        let (sin, cos) = pitch.to_radians().sin_cos();
        View {
            geometry,
            screen,
            step: 2.0 * (fov.to_radians() / 2.0).tan() / screen[0],
            pitch: [sin, cos],
        }
    }

    /// What a pixel sees of a texture with a mip 0 of `size` texels; none is the sky.
    pub(super) fn hit(&self, pixel: [u32; 2], size: [u32; 2]) -> Option<Hit> {
        let centre = pixel.map(|p| f64::from(p) + 0.5);
        // Right and up from the middle of the image plane.
        let x = (centre[0] - self.screen[0] / 2.0) * self.step;
        let y = (self.screen[1] / 2.0 - centre[1]) * self.step;
        match self.geometry {
            Geometry::Quad { scale } => {
                let [across, down] = size.map(|texels| scale / f64::from(texels));
                Some(Hit {
                    uv: [centre[0] * across, centre[1] * down],
                    dx: [across, 0.0],
                    dy: [0.0, down],
                })
            }
            Geometry::Plane { height, size, .. } => self.on_plane([x, y], height / size),
            Geometry::Sphere {
                distance, repeat, ..
            } => self.on_sphere([x, y], distance, repeat),
        }
    }

    /// The camera looks along (0, −sin, cos) of the pitch; up is (0, cos, sin). A ray is the look
    /// plus x to the right plus y up, and meets the floor where it has fallen by the height.
    fn on_plane(&self, [x, y]: [f64; 2], height: f64) -> Option<Hit> {
        let [sin, cos] = self.pitch;
        let fall = sin - y * cos;
        if fall <= 0.0 {
            return None;
        }
        let reach = height / fall;
        // What a step of one pixel moves the point by, per unit of 1 / fall.
        let across = reach * self.step;
        Some(Hit {
            uv: [x * reach, (cos + y * sin) * reach],
            dx: [across, 0.0],
            dy: [-across * x * cos / fall, -across / fall],
        })
    }

    /// The camera looks along z; the sphere's middle is at (0, 0, `distance`).
    fn on_sphere(&self, [x, y]: [f64; 2], distance: f64, repeat: f64) -> Option<Hit> {
        let ray = [x, y, 1.0];
        let square = x * x + y * y + 1.0;
        let discriminant = distance * distance - square * (distance * distance - 1.0);
        if discriminant <= 0.0 {
            return None;
        }
        let reach = (distance - discriminant.sqrt()) / square;
        let normal = [reach * x, reach * y, reach - distance];
        let facing = dot(normal, ray);
        let round = normal[0] * normal[0] + normal[2] * normal[2];
        let turn = repeat / std::f64::consts::TAU;
        // The point moves in the tangent plane: reach · d(ray) less what leads out of it, along the ray.
        let moved = |axis: usize, step: f64| {
            let along = reach * step * normal[axis] / facing;
            let mut motion = ray.map(|component| -along * component);
            motion[axis] += reach * step;
            [
                turn * (normal[0] * motion[2] - normal[2] * motion[0]) / round,
                -motion[1] / (std::f64::consts::PI * round.sqrt()),
            ]
        };
        let longitude = normal[0].atan2(-normal[2]);
        let latitude = normal[1].clamp(-1.0, 1.0).acos();
        Some(Hit {
            uv: [
                repeat / 2.0 + longitude * turn,
                latitude / std::f64::consts::PI,
            ],
            dx: moved(0, self.step),
            dy: moved(1, -self.step),
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENES: [Geometry; 4] = [
        Geometry::Quad { scale: 2.5 },
        Geometry::Plane {
            height: 1.7,
            pitch: 10.0,
            fov: 60.0,
            size: 2.0,
        },
        Geometry::Plane {
            height: 3.0,
            pitch: 90.0,
            fov: 90.0,
            size: 1.0,
        },
        Geometry::Sphere {
            distance: 2.0,
            fov: 60.0,
            repeat: 3.0,
        },
    ];

    /// By the mean value theorem a difference between two points is the gradient somewhere between
    /// them: nearer to the first one's than the second one's is, where the gradient rises or falls.
    #[test]
    fn gradients_are_what_neighbouring_points_of_the_screen_differ_by() {
        /// Pixels of the fine screen along a pixel of the coarse one; odd, so that middles meet.
        const FINER: u32 = 1025;
        /// Of coordinates of about 1 whose differences, about 2^−16, are taken: 2^−52 and a margin
        /// of 2^6 for the roundings before.
        const ROUNDING: f64 = 1.0 / (1_u64 << 46) as f64;
        for geometry in SCENES {
            let coarse = View::new(geometry, [64, 48]);
            let fine = View::new(geometry, [64 * FINER, 48 * FINER]);
            let texture = [64 * FINER; 2];
            let mut found = 0;
            for [x, y] in (0..48).flat_map(|y| (0..64).map(move |x| [x, y])) {
                let middle = [x, y].map(|p| p * FINER + FINER / 2);
                let at = |dx: u32, dy: u32| fine.hit([middle[0] + dx, middle[1] + dy], texture);
                let (Some(here), Some(right), Some(below)) = (at(0, 0), at(1, 0), at(0, 1)) else {
                    continue;
                };
                found += 1;
                let hit = coarse.hit([x, y], [64; 2]).unwrap();
                for axis in 0..2 {
                    let rounding = ROUNDING * here.uv[axis].abs().max(1.0);
                    assert!((hit.uv[axis] - here.uv[axis]).abs() <= rounding);
                    for (there, of) in [
                        (right, (|h| h.dx) as fn(Hit) -> [f64; 2]),
                        (below, |h| h.dy),
                    ] {
                        let [first, second] = [here, there].map(|h| of(h)[axis]);
                        let difference = there.uv[axis] - here.uv[axis];
                        let bound = (second - first).abs() + rounding;
                        assert!((difference - first).abs() <= bound, "{geometry:?} {x} {y}");
                        let coarse_step = of(hit)[axis];
                        let ratio = coarse_step - first * f64::from(FINER);
                        assert!(ratio.abs() <= rounding + ROUNDING * coarse_step.abs());
                    }
                }
            }
            assert!(found > 100, "{geometry:?} is seen");
        }
    }

    #[test]
    fn numbers_outside_their_range_are_refused() {
        assert!(SCENES.iter().all(|scene| scene.refused().is_none()));
        let refused = |geometry: Geometry| geometry.refused().map(|p| p.name);
        assert_eq!(refused(Geometry::Quad { scale: f64::NAN }), Some("scale"));
        assert_eq!(refused(Geometry::Quad { scale: 0.0 }), Some("scale"));
        let sphere = |distance, fov| Geometry::Sphere {
            distance,
            fov,
            repeat: 1.0,
        };
        assert_eq!(refused(sphere(1.0, 60.0)), Some("distance"));
        assert_eq!(refused(sphere(2.0, 180.0)), Some("fov"));
    }
}
