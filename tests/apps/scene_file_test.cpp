/// Scene files: what they say reaches the scene, and what is wrong in them is named with its line.

#include "apps/scene_file.hpp"

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

namespace tissuewarp::apps {
namespace {

using testing::HasSubstr;

class SceneFiles : public testing::Test {
protected:
    SceneFiles()
        : folder_(std::filesystem::temp_directory_path() / ("tissuewarp-scenes-" + std::to_string(::getpid()))) {
        std::filesystem::create_directories(folder_);
    }
    ~SceneFiles() override { std::filesystem::remove_all(folder_); }

    [[nodiscard]] simulation::Scene read(const std::string& text) const {
        std::ofstream(folder_ / "scene.toml") << text;
        return read_scene(folder_ / "scene.toml");
    }

    /// The message of the refusal, which names the file.
    [[nodiscard]] std::string refusal(const std::string& text) const {
        try {
            (void)read(text);
        } catch (const InvalidInput& error) {
            EXPECT_THAT(error.what(), HasSubstr("scene.toml"));
            return error.what();
        }
        ADD_FAILURE() << "was read:\n" << text;
        return {};
    }

    std::filesystem::path folder_;
};

// Nine lines, so that what follows begins on line 10.
const std::string cube = R"(title = "cube"
[geometry]
box = { size_mm = [10, 20, 30], cells = [1, 2, 3] }
[label.1]
youngs_modulus_kpa = 3.0
poissons_ratio = 0.45
[set.base]
side = "-z"

)";

TEST_F(SceneFiles, SayWhatTheSceneHolds) {
    const simulation::Scene scene = read("density_kg_m3 = 1050\n" + cube);
    EXPECT_EQ(scene.title, "cube");
    EXPECT_NEAR(scene.density, 1.05e-6, 1e-15) << "kg/mm³";
    EXPECT_EQ(std::get<simulation::BoxGeometry>(scene.geometry).size.z(), 30);
    EXPECT_NEAR(tled::shear_modulus(scene.tissues.at(1).material), 3.0 / 2.9, 1e-12);
    EXPECT_EQ(scene.sets.at("base").side->axis, 2);
    EXPECT_FALSE(scene.sets.at("base").side->upper);
    EXPECT_FALSE(scene.gravity || scene.fluid);
    EXPECT_TRUE(scene.fixed.empty() && scene.contacts.empty()) << "nothing that is not named";
}

TEST_F(SceneFiles, GiveEveryEffectItsNumbers) {
    const simulation::Scene scene = read(cube + R"(
[set.top]
side = "+z"
depth_mm = 2
without = ["base"]
[[fixed]]
set = "base"
axes = "xz"
[[motion]]
set = "top"
displacement_mm = [0, 0, -2]
curve = [[0, 0], [0.5, 1]]
[[motion]]
set = "base"
axes = "y"
rotation = { point_mm = [1, 2, 3], axis = [0, 0, 2], degrees = 90 }
[[springs]]
set = "top"
stiffness_kpa_per_mm = 0.5
along = "normal"
[gravity]
from = [0, 0, -2]
to = [0, 3, 0]
[fluid]
from_mm = 30
to_mm = 10
density_kg_m3 = 1010
[[pressure]]
set = "top"
pressure_kpa = 1.5
[[traction]]
set = "top"
traction_kpa = [0.1, 0, -0.2]
[[membrane]]
set = "top"
shear_modulus_kpa = 100
thickness_mm = 0.5
[[contact]]
plane = { point_mm = [0, 0, -1], normal = [0, 0, 2] }
friction = 0.3
gap_mm = 0.5
[[resection]]
set = "top"
time_s = 0.25
[solve]
kind = "dynamics"
duration_s = 2
frames = 4
damping_per_s = 5
step_s = 1e-5
device = "cpu"
element = "t4"
[[probe]]
name = "middle"
at_mm = [5, 10, 15]
)");
    EXPECT_EQ(scene.fixed.at(0).axes, (std::array{true, false, true}));
    EXPECT_EQ(scene.motions.at(0).motion.displacement.z(), -2);
    EXPECT_EQ(scene.motions.at(0).curve.points.size(), 2u);
    EXPECT_NEAR(scene.motions.at(1).motion.turn.z(), std::numbers::pi / 2, 1e-12);
    EXPECT_EQ(scene.motions.at(1).motion.point, Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(scene.tractions.at(0).traction, Eigen::Vector3d(0.1, 0, -0.2));
    EXPECT_EQ(scene.springs.at(0).per_area, 0.5);
    EXPECT_EQ(scene.springs.at(0).along, simulation::Springs::Along::Normal);
    EXPECT_EQ(*scene.gravity->from, Eigen::Vector3d(0, 0, -1)) << "a direction of length 1";
    EXPECT_EQ(scene.gravity->to, Eigen::Vector3d(0, 1, 0));
    EXPECT_EQ(scene.gravity->magnitude, 9810);
    EXPECT_NEAR(scene.fluid->density, 1.01e-6, 1e-15);
    EXPECT_EQ(scene.fluid->to, 10);
    EXPECT_EQ(scene.pressures.at(0).pressure, 1.5);
    EXPECT_EQ(scene.membranes.at(0).thickness, 0.5);
    EXPECT_EQ(std::get<simulation::HalfSpace>(scene.contacts.at(0).body).normal.z(), 1);
    EXPECT_EQ(scene.contacts.at(0).gap, 0.5);
    EXPECT_EQ(scene.resections.at(0).time, 0.25);
    EXPECT_EQ(scene.solve.kind, simulation::Solve::Kind::Dynamics);
    EXPECT_EQ(scene.solve.step, 1e-5);
    EXPECT_EQ(scene.solve.device, simulation::Device::Cpu);
    EXPECT_EQ(*scene.solve.element, tled::Element::T4);
    EXPECT_EQ(scene.probes.at(0).name, "middle");
    EXPECT_EQ(scene.sets.at("top").without, std::vector<std::string>{"base"});
}

TEST_F(SceneFiles, KnowTheLawsAndTissues) {
    const std::string head = "[geometry]\nbox = { size_mm = [1, 1, 1], cells = [1, 1, 1] }\n[label.1]\n";
    const auto law = [&](const std::string& text) { return tled::law_name(read(head + text).tissues.at(1).material); };
    EXPECT_EQ(law("law = \"ogden\"\nterms = [[-0.358, -4.7]]\nbulk_modulus_kpa = 40\n"), "ogden");
    EXPECT_EQ(law("law = \"yeoh\"\nc10_kpa = 1\nc20_kpa = 0.1\nc30_kpa = 0.1\nbulk_modulus_kpa = 40\n"), "polynomial");
    EXPECT_EQ(law("law = \"mooney-rivlin\"\nc10_kpa = 1\nc01_kpa = 0.1\nbulk_modulus_kpa = 40\n"), "polynomial");
    EXPECT_EQ(law("law = \"arruda-boyce\"\nshear_modulus_kpa = 1\nlocking_stretch = 1.2\nbulk_modulus_kpa = 40\n"),
              "arruda_boyce");
    EXPECT_EQ(law("law = \"transversely-isotropic\"\nshear_modulus_kpa = 1\nbulk_modulus_kpa = 40\n"
                  "fibre_modulus_kpa = 5\nfibre = [0, 2, 0]\n"),
              "transversely_isotropic");
    EXPECT_EQ(law("law = \"neo-hookean-stable\"\nyoungs_modulus_kpa = 3\npoissons_ratio = 0.4\n"),
              "neo_hookean_stable");
    const auto brain = read(head + "preset = \"brain-miller-chinzei\"\n").tissues.at(1);
    EXPECT_NEAR(tled::shear_modulus(brain.material), 0.842, 1e-12);
    EXPECT_EQ(brain.viscosity.terms.size(), 2u);
    const auto viscous = read(head + "preset = \"brain-taylor-2007\"\nprony = [[0.3, 0.5]]\n").tissues.at(1);
    EXPECT_EQ(viscous.viscosity.terms.at(0).relative_modulus, 0.3);
}

TEST_F(SceneFiles, TurnBodiesByDegreesAboutAnAxisThroughAPoint) {
    const std::string ball = cube + "[[contact]]\nball = { centre_mm = [5, 5, 40], radius_mm = 4 }\n";
    const simulation::RigidMotion still = read(ball).contacts.at(0).motion;
    EXPECT_TRUE(still.turn.isZero(0.0) && still.displacement.isZero(0.0));
    const simulation::RigidMotion motion =
        read(ball +
             "displacement_mm = [0, 0, -3]\nrotation = { point_mm = [1, 2, 3], axis = [0, -2, 0], degrees = 90 }\n")
            .contacts.at(0)
            .motion;
    EXPECT_EQ(motion.displacement, Eigen::Vector3d(0, 0, -3));
    EXPECT_EQ(motion.point, Eigen::Vector3d(1, 2, 3));
    EXPECT_LT((motion.turn - Eigen::Vector3d(0, -std::acos(-1.0) / 2, 0)).norm(), 1e-12);
    const auto turned = [&](const std::string& keys) { return refusal(ball + "rotation = { " + keys + " }\n"); };
    EXPECT_THAT(turned("point_mm = [1, 2, 3], axis = [0, 1, 0]"),
                testing::AllOf(HasSubstr("line 12"), HasSubstr("and 'degrees'")));
    EXPECT_THAT(turned("point_mm = [1, 2, 3], degrees = 5"), HasSubstr("axis"));
    EXPECT_THAT(turned("axis = [0, 1, 0], degrees = 5"), HasSubstr("needs 'point_mm'"));
    EXPECT_THAT(turned("point_mm = [1, 2, 3], axis = [0, 0, 0], degrees = 5"), HasSubstr("[0, 0, 0]"));
    EXPECT_THAT(turned("point_mm = [1, 2, 3], axis = [0, 1, 0], degrees = 5, radians = 1"), HasSubstr("'radians'"));
    EXPECT_THAT(turned("point_mm = [1, 2, 3], axis = [0, 1, 0], degrees = 1e6"), HasSubstr("36000"));
    EXPECT_THAT(turned("point_mm = [1, 2, 3], axis = [0, 1, 0], degree = 5"), HasSubstr("'degrees'"));
    EXPECT_THAT(turned("pont_mm = [1, 2, 3], axis = [0, 1, 0], degrees = 90"), HasSubstr("'point_mm'"));
    EXPECT_THAT(refusal(ball + "rotaton = { }\n"), HasSubstr("did you mean 'rotation'"));
}

TEST_F(SceneFiles, TakeFibresOfOneKind) {
    const std::string law =
        "[label.1]\nlaw = \"transversely-isotropic\"\nshear_modulus_kpa = 1\n"
        "bulk_modulus_kpa = 40\nfibre_modulus_kpa = 5\n";
    const std::string box = "[geometry]\nbox = { size_mm = [10, 10, 10], cells = [1, 1, 1] }\n" + law;
    const std::string mesh = "[geometry]\nmesh = \"bar.vtu\"\n" + law;
    const meshing::TetMesh bar = meshing::box_mesh({10, 10, 10}, {1, 1, 1});
    const Eigen::MatrixXd along = Eigen::Vector3d(0, 3, 0).replicate(1, bar.tet_count());
    meshing::write_vtu(bar, folder_ / "bar.vtu", {}, {{"fibre", along}, {"J", along.row(1)}});
    imaging::Geometry grid;
    grid.size = {4, 4, 4};
    imaging::write_volume(imaging::Volume(grid, CV_32FC3), folder_ / "fibres.nii.gz");
    imaging::write_volume(imaging::Volume(grid, CV_32FC1), folder_ / "numbers.nii.gz");

    const auto& direction =
        std::get<tled::TransverselyIsotropic>(read(box + "fibre = [0, 2, 0]\n").tissues.at(1).material);
    EXPECT_EQ(direction.fibre, Eigen::Vector3d(0, 1, 0));
    const auto volume = read(box + "fibre_file = \"fibres.nii.gz\"\n").tissues.at(1).fibres;
    EXPECT_EQ(std::get<simulation::FibreVolume>(volume).directions.geometry.size, grid.size);
    const auto array = read(mesh + "fibre_array = \"fibre\"\n").tissues.at(1).fibres;
    EXPECT_EQ(std::get<simulation::FibresOfTetrahedra>(array).directions, along);

    EXPECT_THAT(refusal(box), testing::AllOf(HasSubstr("line 3"), HasSubstr("'fibre_file'")));
    EXPECT_THAT(refusal(box + "fibre = [0, 2, 0]\nfibre_file = \"fibres.nii.gz\"\n"), HasSubstr("takes one of"));
    EXPECT_THAT(refusal(box + "fibre_file = \"numbers.nii.gz\"\n"),
                testing::AllOf(HasSubstr("line 8"), HasSubstr("three components")));
    EXPECT_THAT(refusal(box + "fibre_array = \"fibre\"\n"), testing::AllOf(HasSubstr("line 8"), HasSubstr("'mesh'")));
    EXPECT_THAT(refusal(mesh + "fibre_array = \"J\"\n"), testing::AllOf(HasSubstr("line 8"), HasSubstr("three")));
    EXPECT_THAT(refusal(box + "fiber = [0, 2, 0]\n"), testing::AllOf(HasSubstr("line 8"), HasSubstr("'fibre'")));
    EXPECT_THAT(refusal(box + "fibre_arry = \"a\"\n"), HasSubstr("did you mean 'fibre_array'"));
    EXPECT_THAT(refusal(cube.substr(0, cube.find("[set")) + "fibre = [0, 2, 0]\n"), HasSubstr("'fibre'"));
    EXPECT_THROW((void)read(mesh + "fibre_array = \"fiber\"\n"), InvalidInput);
}

TEST_F(SceneFiles, OpenInterfacesBetweenLabelsOrSets) {
    using simulation::Sliding;
    const std::string sets = cube + "[set.upper]\nhalf_space = { point_mm = [0, 0, 15], normal = [0, 0, -1] }\n";
    const Sliding free = read(sets + "[[sliding]]\nsets = [\"base\", \"upper\"]\nopening = \"free\"\n").sliding.at(0);
    EXPECT_EQ((*free.sets)[1], "upper");
    EXPECT_EQ(free.opening, Sliding::Opening::Free);
    const Sliding held = read(sets + "[[sliding]]\nsets = [\"base\", \"upper\"]\n").sliding.at(0);
    EXPECT_EQ(held.opening, Sliding::Opening::Held);
    const auto slides = [&](const std::string& keys) { return refusal(sets + "[[sliding]]\n" + keys); };
    EXPECT_THAT(slides("sets = [\"base\", \"uper\"]\n"),
                testing::AllOf(HasSubstr("line 13"), HasSubstr("did you mean 'upper'")));
    EXPECT_THAT(slides("sets = [\"base\"]\n"), HasSubstr("two 'sets'"));
    EXPECT_THAT(slides("sets = [\"base\", \"base\"]\n"), HasSubstr("on itself"));
    EXPECT_THAT(slides("sets = [\"base\", \"upper\"]\nlabels = [1, 2]\n"), HasSubstr("two 'labels', [a, b], or"));
    EXPECT_THAT(slides("opening = \"free\"\n"), HasSubstr("two 'labels', [a, b], or"));
    EXPECT_THAT(slides("sets = [\"base\", \"upper\"]\nopening = \"fre\"\n"), HasSubstr("did you mean 'free'"));
    EXPECT_THAT(slides("sets = [\"base\", \"upper\"]\nopenning = \"free\"\n"), HasSubstr("'opening'"));
}

TEST_F(SceneFiles, SayHowAnEquilibriumIsSought) {
    const simulation::Solve by_default = read(cube).solve,
                            forced =
                                read(cube + "[solve]\nmethod = \"newton\"\nload_steps = 7\nprecision = \"float64\"\n")
                                    .solve;
    EXPECT_EQ(by_default.method, tled::EquilibriumMethod::Automatic);
    EXPECT_EQ(by_default.precision, tled::Scalar::Float32);
    EXPECT_EQ(forced.method, tled::EquilibriumMethod::Newton);
    EXPECT_EQ(forced.load_steps, 7);
    EXPECT_EQ(forced.precision, tled::Scalar::Float64);
    EXPECT_THAT(refusal(cube + "[solve]\nmethod = \"neuton\"\n"), HasSubstr("did you mean 'newton'"));
}

TEST_F(SceneFiles, NameTheLineAndTheNearestKey) {
    EXPECT_THAT(refusal(cube + "[solve]\nframse = 3\n"), testing::AllOf(HasSubstr("line 11"), HasSubstr("'frames'")));
    EXPECT_THAT(refusal(cube + "[slove]\n"), testing::AllOf(HasSubstr("line 10"), HasSubstr("'solve'")));
    EXPECT_THAT(refusal(cube + "[set.a]\nbal = { centre_mm = [0, 0, 0], radius_mm = 1 }\n"), HasSubstr("'ball'"));
    EXPECT_THAT(refusal(cube + "[set.a]\nball = { center_mm = [0, 0, 0], radius_mm = 1 }\n"), HasSubstr("'centre_mm'"));
    EXPECT_THAT(refusal(cube + "[[pressure]]\nset = \"base\"\npressure_kpa = 1\npresure = 1\n"), HasSubstr("pressure"));
    EXPECT_THAT(refusal(cube + "[gravity]\nto = [0, 0, 1]\nmagnitude = 9.81\n"), HasSubstr("'magnitude_mm_s2'"));
}

TEST_F(SceneFiles, RefuseOtherUnitsAndValuesOutOfRange) {
    EXPECT_THAT(refusal(cube + "[[pressure]]\nset = \"base\"\npressure_mmhg = 12\n"),
                testing::AllOf(HasSubstr("lacks 'pressure_kpa' (kPa)")));
    EXPECT_THAT(refusal("density_kg_m3 = 1e-6\n" + cube), testing::AllOf(HasSubstr("line 1"), HasSubstr("kg/m3")));
    EXPECT_THAT(refusal(cube + "[gravity]\nto = [0, 0, 1]\nmagnitude_mm_s2 = -1\n"), HasSubstr("mm/s2"));
    EXPECT_THAT(refusal(cube + "[gravity]\nto = [0, 0, 0]\n"), HasSubstr("[0, 0, 0]"));
    EXPECT_THAT(refusal(cube + "[solve]\nduration_s = \"1\"\n"), HasSubstr("must be a number (s)"));
    EXPECT_THAT(refusal(cube + "[solve]\nframes = 1.5\n"), HasSubstr("whole number"));
    EXPECT_THAT(refusal(cube + "[solve]\nkind = \"dynamic\"\n"), HasSubstr("did you mean 'dynamics'"));
    EXPECT_THAT(refusal(cube + "[set.a]\nside = \"x\"\n"), HasSubstr("'+x'"));
    EXPECT_THAT(refusal(cube + "[set.a]\ndepth_mm = 1\n"), HasSubstr("'side'"));
    EXPECT_THAT(refusal(cube + "[set.a]\nbox = { lower_mm = [0, 0, 0], upper_mm = [1, -1, 1] }\n"),
                HasSubstr("upper_mm"));
    EXPECT_THAT(refusal(cube + "[[fixed]]\nset = \"base\"\naxes = \"xw\"\n"), HasSubstr("xyz"));
    EXPECT_THAT(refusal(cube + "[[motion]]\nset = \"base\"\ndisplacement_mm = [0, 1]\n"), HasSubstr("three numbers"));
    EXPECT_THAT(refusal(cube + "[[motion]]\nset = \"base\"\ndisplacement_mm = [0, 0, 1]\ncurve = [[1, 0], [0, 1]]\n"),
                testing::AllOf(HasSubstr("line 13"), HasSubstr("order")));
    EXPECT_THAT(refusal(cube + "[[resection]]\nset = \"base\"\ntime_s = 7\n"), HasSubstr("7.0"));
    EXPECT_THAT(refusal("[geometry]\nbox = { size_mm = [1, 1, 1], cells = [1, 1, 1] }\n[label.1]\n"
                        "youngs_modulus_kpa = 3\npoissons_ratio = 0.5\n"),
                testing::AllOf(HasSubstr("line 5"), HasSubstr("0.4999")));
    EXPECT_THAT(refusal("[geometry]\nbox = { size_mm = [1, 1, 1], cells = [1, 1, 1] }\n[label.1]\n"
                        "preset = \"brain-taylor-2007\"\nprony = [[1.2, 1]]\n"),
                HasSubstr("line 3"));
}

TEST_F(SceneFiles, RefuseNamesThatNothingHas) {
    EXPECT_THAT(refusal(cube + "[[fixed]]\nset = \"bose\"\n"),
                testing::AllOf(HasSubstr("line 11"), HasSubstr("did you mean 'base'")));
    EXPECT_THAT(refusal(cube + "[set.a]\nwithout = [\"nothing\"]\n"), HasSubstr("'nothing'"));
    EXPECT_THAT(refusal(cube + "[set.a]\nsurface_of = 7\n"),
                testing::AllOf(HasSubstr("label 7"), HasSubstr("[label.7]")));
    EXPECT_THAT(refusal(cube + "[label.2]\npreset = \"breast-fat\"\n"), HasSubstr("label 2 has a tissue"));
    EXPECT_THAT(refusal(cube + "[[sliding]]\nlabels = [1, 2]\n"), HasSubstr("label 2 slides"));
    EXPECT_THAT(refusal(cube + "[[contact]]\nlabel = 4\n"), HasSubstr("label 4 is a body in contact"));
    EXPECT_THAT(refusal("[geometry]\nbox = { size_mm = [1, 1, 1], cells = [1, 1, 1] }\n[label.1]\n"
                        "preset = \"brain-taylor\"\n"),
                HasSubstr("did you mean 'brain-taylor-2007'"));
}

TEST_F(SceneFiles, RefuseTwoOfWhatThereIsOneOf) {
    EXPECT_THAT(refusal(cube + "[[contact]]\nball = { centre_mm = [0, 0, 0], radius_mm = 1 }\nlabel = 1\n"),
                HasSubstr("takes one of"));
    EXPECT_THAT(refusal(cube + "[[contact]]\nfriction = 1\n"), HasSubstr("takes one of"));
    EXPECT_THAT(refusal(cube + "[[springs]]\nset = \"base\"\n"), HasSubstr("take one of"));
    EXPECT_THAT(refusal(cube + "[fluid]\nfrom_mm = 1\nto_mm = 0\n"), HasSubstr("gravity"));
    EXPECT_THAT(refusal("[geometry]\n[label.1]\npreset = \"breast-fat\"\n"), HasSubstr("takes one of"));
    EXPECT_THAT(refusal("[label.1]\npreset = \"breast-fat\"\n"), HasSubstr("[geometry]"));
    EXPECT_THAT(refusal("[geometry]\nbox = { size_mm = [1, 1, 1], cells = [1, 1, 1] }\n"), HasSubstr("[label.1]"));
    EXPECT_THAT(
        refusal(cube + "[[probe]]\nname = \"a\"\nat_mm = [0, 0, 0]\n[[probe]]\nname = \"a\"\nat_mm = [0, 0, 0]\n"),
        HasSubstr("named 'a'"));
    EXPECT_THROW(
        (void)read(cube.substr(0, cube.find("box")) + "mesh = \"nowhere.vtu\"\n" + cube.substr(cube.find("[label"))),
        IoError);
}

}  // namespace
}  // namespace tissuewarp::apps
