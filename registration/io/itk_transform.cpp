#include "registration/io/itk_transform.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Parameters and centre of one transform, checked.
class Parameters {
public:
    Parameters(const ItkTransform& transform, const std::filesystem::path& path) : transform_(transform), path_(path) {}

    void require(std::size_t count) const {
        if (transform_.parameters.size() == count) return;
        throw InvalidInput("'" + path_.string() + "' has " + std::to_string(transform_.parameters.size()) +
                           " parameters of an " + transform_.type + "; it takes " + std::to_string(count));
    }
    [[nodiscard]] Vector3d vector(std::size_t first) const { return Vector3d::Map(&transform_.parameters[first]); }
    [[nodiscard]] double operator[](std::size_t n) const { return transform_.parameters[n]; }

    /// M (x − c) + c + t
    [[nodiscard]] Eigen::Affine3d about_centre(const Matrix3d& matrix, const Vector3d& translation) const {
        const Vector3d centre = transform_.fixed.size() >= 3 ? Vector3d(Vector3d::Map(transform_.fixed.data()))
                                                             : Vector3d(Vector3d::Zero());
        Eigen::Affine3d result = Eigen::Affine3d::Identity();
        result.linear() = matrix;
        result.translation() = centre + translation - matrix * centre;
        return result;
    }

private:
    const ItkTransform& transform_;
    const std::filesystem::path& path_;
};

/// Of the imaginary part of a unit quaternion.
Matrix3d versor(const Vector3d& v) {
    const double real = std::sqrt(std::max(0.0, 1 - v.squaredNorm()));
    return Eigen::Quaterniond(real, v[0], v[1], v[2]).normalized().toRotationMatrix();
}

/// itk::Euler3DTransform turns about y, x, z in this order, or x, y, z where its fixed parameters say so.
Matrix3d euler(const Vector3d& angles, bool zyx) {
    const Matrix3d x = AngleAxisd(angles[0], Vector3d::UnitX()).toRotationMatrix(),
                   y = AngleAxisd(angles[1], Vector3d::UnitY()).toRotationMatrix(),
                   z = AngleAxisd(angles[2], Vector3d::UnitZ()).toRotationMatrix();
    return zyx ? Matrix3d(z * y * x) : Matrix3d(z * x * y);
}

/// Nothing where the type is none of these.
std::optional<Eigen::Affine3d> linear(const ItkTransform& transform, const std::filesystem::path& path) {
    const Parameters p(transform, path);
    const std::string name = transform.type.substr(0, transform.type.find('_'));
    if (name == "IdentityTransform") return Eigen::Affine3d::Identity();
    if (name == "TranslationTransform") {
        p.require(3);
        return Eigen::Affine3d(Eigen::Translation3d(p.vector(0)));
    }
    if (name == "AffineTransform" || name == "MatrixOffsetTransformBase" || name == "Rigid3DTransform") {
        p.require(12);
        const Matrix3d matrix =
            Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(transform.parameters.data());
        return p.about_centre(matrix, p.vector(9));
    }
    if (name == "Euler3DTransform") {
        p.require(6);
        return p.about_centre(euler(p.vector(0), transform.fixed.size() > 3 && transform.fixed[3] != 0), p.vector(3));
    }
    if (name == "VersorRigid3DTransform") {
        p.require(6);
        return p.about_centre(versor(p.vector(0)), p.vector(3));
    }
    if (name == "QuaternionRigidTransform") {
        p.require(7);
        return p.about_centre(Eigen::Quaterniond(p[3], p[0], p[1], p[2]).normalized().toRotationMatrix(), p.vector(4));
    }
    if (name == "Similarity3DTransform") {
        p.require(7);
        return p.about_centre(p[6] * versor(p.vector(0)), p.vector(3));
    }
    return std::nullopt;
}

/// Its fixed parameters are size, origin, spacing and, by rows, direction.
imaging::Volume field_of(const ItkTransform& transform, const std::filesystem::path& path) {
    const auto& f = transform.fixed;
    if (f.size() != 18) throw InvalidInput("'" + path.string() + "' has a displacement field that is not of 3-D");
    imaging::Geometry grid;
    for (std::size_t axis = 0; axis < 3; ++axis) grid.size[axis] = static_cast<int>(std::clamp(f[axis], 0.0, 1e6));
    grid.origin = Vector3d::Map(&f[3]);
    grid.spacing = Vector3d::Map(&f[6]);
    grid.direction = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&f[9]);
    imaging::require_valid(grid, path.string().c_str());
    if (static_cast<long long>(transform.parameters.size()) != 3 * grid.voxel_count())
        throw InvalidInput("'" + path.string() + "' has a displacement field whose vectors do not fill its grid");
    imaging::Volume field(grid, CV_32FC3);
    std::transform(transform.parameters.begin(), transform.parameters.end(), field.data<float>(),
                   [](double v) { return static_cast<float>(v); });
    return field;
}

}  // namespace

PointMap composed(const std::vector<ItkTransform>& transforms, const std::filesystem::path& path) {
    PointMap map;
    std::vector<ItkTransform> parts = transforms;
    const bool composite = !parts.empty() && parts.front().type.starts_with("CompositeTransform");
    if (composite) parts.erase(parts.begin());
    if (parts.empty()) throw InvalidInput("'" + path.string() + "' holds no transform");
    if (parts.size() > 1 && !composite)
        throw InvalidInput("'" + path.string() + "' holds " + std::to_string(parts.size()) +
                           " transforms that are no composition; save one");
    for (const ItkTransform& part : parts) {
        for (const std::vector<double>* numbers : {&part.parameters, &part.fixed})
            if (!std::all_of(numbers->begin(), numbers->end(), [](double v) { return std::isfinite(v); }))
                throw InvalidInput("'" + path.string() + "' has parameters of an " + part.type +
                                   " that are not finite; save the transform again");
        if (const auto step = linear(part, path)) {
            (map.field ? map.before : map.after) = (map.field ? map.before : map.after) * *step;
        } else if (part.type.starts_with("DisplacementFieldTransform") && !map.field) {
            map.field = field_of(part, path);
        } else {
            throw InvalidInput("'" + path.string() + "' holds an " + part.type +
                               (map.field ? " beside a displacement field" : "") +
                               ", which is not read; save a rigid or affine transform");
        }
    }
    return map;
}

}  // namespace tissuewarp::registration::detail
