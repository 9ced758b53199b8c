#include "tled/discretisation_error.hpp"

#include "core/errors.hpp"
#include "tled/detail/bubble_conditions.hpp"
#include "tled/detail/hierarchical_stiffness.hpp"
#include "tled/detail/kinematics.hpp"
#include "tled/detail/parallel.hpp"
#include "tled/detail/springs.hpp"

#include <Eigen/LU>

#include <chrono>
#include <cmath>

namespace tissuewarp::tled {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// Corners and bubbles of one Newton step.
class Enrichment {
public:
    Enrichment(const detail::HierarchicalSpace& space, const detail::HierarchicalStiffness& elastic,
               const detail::BubbleConditions& bubbles, const RestStiffness& corners,
               const NodalConditions& conditions);

    [[nodiscard]] Matrix3Xd multiply(const Matrix3Xd& x) const;
    /// K⁻¹ of the corners at rest beside the inverted blocks of the bubbles.
    [[nodiscard]] Matrix3Xd precondition(const Matrix3Xd& r) const;
    /// Zeros in what is prescribed.
    void constrain(Matrix3Xd& x) const;

private:
    const detail::HierarchicalSpace& space_;
    const detail::HierarchicalStiffness& elastic_;
    const detail::BubbleConditions& bubbles_;
    const RestStiffness& corners_;
    const NodalConditions& conditions_;
    std::vector<Matrix3d> inverse_;
};

Enrichment::Enrichment(const detail::HierarchicalSpace& space, const detail::HierarchicalStiffness& elastic,
                       const detail::BubbleConditions& bubbles, const RestStiffness& corners,
                       const NodalConditions& conditions)
    : space_(space),
      elastic_(elastic),
      bubbles_(bubbles),
      corners_(corners),
      conditions_(conditions),
      inverse_(elastic.bubble_blocks()) {
    for (const auto& [edge, K] : bubbles.stiffness) inverse_[edge] += K;
    parallel_for(0, space.edge_count(), [&](int edge) {
        for (int c = 0; c < 3; ++c) {
            if (!bubbles.constrained(c, edge)) continue;
            inverse_[edge].row(c).setZero();
            inverse_[edge].col(c).setZero();
            inverse_[edge](c, c) = 1.0;
        }
        inverse_[edge] = inverse_[edge].inverse().eval();
    });
}

void Enrichment::constrain(Matrix3Xd& x) const {
    x.leftCols(space_.corner_count) = conditions_.constrained.select(0.0, x.leftCols(space_.corner_count));
    x.rightCols(space_.edge_count()) = bubbles_.constrained.select(0.0, x.rightCols(space_.edge_count()));
}

Matrix3Xd Enrichment::multiply(const Matrix3Xd& x) const {
    Matrix3Xd y = elastic_.multiply(x);
    detail::add_spring_resistance(conditions_, x, y);
    for (const auto& [edge, K] : bubbles_.stiffness) {
        y.col(space_.corner_count + edge) += K * x.col(space_.corner_count + edge);
    }
    constrain(y);
    return y;
}

static Matrix3Xd jac(const Enrichment& K, const std::vector<Matrix3d>& inv, const detail::HierarchicalSpace& sp, const Matrix3Xd& r){
 Matrix3Xd z=Matrix3Xd::Zero(3,r.cols());
 parallel_for(0, sp.edge_count(), [&](int edge) { const int i = sp.corner_count + edge; z.col(i) = inv[edge] * r.col(i); });
 K.constrain(z); return z;}
Matrix3Xd Enrichment::precondition(const Matrix3Xd& r) const {
    static int steps = getenv("STEPS")?atoi(getenv("STEPS")):0; static double ratio=getenv("RATIO")?atof(getenv("RATIO")):10; static int mult=getenv("MULT")?atoi(getenv("MULT")):0;
    if (steps>0) {
      static double lmax=0; static const void* who=nullptr;
      if (who!=this){ who=this; Matrix3Xd v=Matrix3Xd::Random(3,space_.size()); for(int k=0;k<15;++k){ v=jac(*this,inverse_,space_,multiply(v)); v.leftCols(space_.corner_count).setZero(); lmax=v.norm(); v/=lmax;} lmax*=1.05; std::fprintf(stderr,"lmax %g\n",lmax);}
      const auto cheb=[&](const Matrix3Xd& rhs, Matrix3Xd x, bool zero){ // bubbles only
        double b=lmax,a=lmax/ratio,theta=(a+b)/2,delta=(b-a)/2,sigma=theta/delta,rho=1/sigma;
        Matrix3Xd res=rhs; if(!zero) res-=multiply(x); res.leftCols(space_.corner_count).setZero();
        Matrix3Xd d=jac(*this,inverse_,space_,res)/theta;
        for(int k=0;k<steps;++k){ x+=d; if(k+1==steps)break; Matrix3Xd Kd=multiply(d); res-=Kd; res.leftCols(space_.corner_count).setZero(); double rn=1/(2*sigma-rho); d=rn*rho*d+2*rn/delta*jac(*this,inverse_,space_,res); rho=rn; }
        return x; };
      Matrix3Xd z=cheb(r,Matrix3Xd::Zero(3,r.cols()),true);
      if(!mult){ z.leftCols(space_.corner_count)=corners_.solve(r.leftCols(space_.corner_count)); constrain(z); return z; }
      Matrix3Xd res=r-multiply(z); z.leftCols(space_.corner_count)+=corners_.solve(res.leftCols(space_.corner_count)); constrain(z);
      return cheb(r,z,false);
    }
    Matrix3Xd z(3, space_.size());
    z.leftCols(space_.corner_count) = corners_.solve(r.leftCols(space_.corner_count));
    parallel_for(0, space_.edge_count(), [&](int edge) {
        const int i = space_.corner_count + edge;
        z.col(i) = inverse_[edge] * r.col(i);
    });
    constrain(z);
    return z;
}

struct Solution {
    Matrix3Xd x;
    int iterations = 0;
    std::string failure;
};

double dot(const Matrix3Xd& a, const Matrix3Xd& b) {
    return a.cwiseProduct(b).sum();
}

// Preconditioned conjugate gradients (Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1).
Solution conjugate_gradients(const Enrichment& K, Matrix3Xd r, const DiscretisationOptions& options) {
    Solution result{.x = Matrix3Xd::Zero(3, r.cols()), .failure = {}};
    Matrix3Xd z = K.precondition(r), p = z;
    double rz = dot(r, z);
    const double limit = options.relative_tolerance * options.relative_tolerance * rz;
    while (rz > limit) {
        if (result.iterations == options.max_iterations) {
            result.failure =
                "conjugate gradients did not converge in " + std::to_string(options.max_iterations) + " iterations";
            return result;
        }
        ++result.iterations;
        const Matrix3Xd Kp = K.multiply(p);
        const double curvature = dot(p, Kp);
        if (!(curvature > 0.0)) {
            result.failure = "the tissue buckles between the nodes: its stiffness there is not positive";
            return result;
        }
        const double step = rz / curvature;
        result.x += step * p;
        r -= step * Kp;
        z = K.precondition(r);
        const double next = dot(r, z);
        p = z + next / rz * p;
        rz = next;
    }
    return result;
}

/// Pressure (kPa) with which the model's own elements are in equilibrium.
VectorXd model_pressure(const Model& model, const RestState& averaged, const VectorXd& jacobian) {
    const std::vector<VolumetricFunction> nodal =
        model.element == Element::T4 ? std::vector<VolumetricFunction>() : detail::nodal_volumetric(averaged, jacobian);
    const std::vector<int> material_of = material_of_elements(averaged);
    VectorXd result(averaged.element_count());
    parallel_for(0, averaged.element_count(), [&](int e) {
        const Material material = detail::element_material(averaged, material_of[e], e);
        result[e] = nodal.empty() ? volumetric_modulus(material) * volumetric_function(material, jacobian[e]).first
                                  : detail::element_pressure(averaged, e, material, jacobian[e], nodal);
    });
    return result;
}

std::string unsupported(const Model& model, const NodalConditions& conditions) {
    const NodalEffects& effects = conditions.effects;
    if (model.hexahedra.count() > 0) return "hexahedra have no estimate";
    if (!effects.surface.empty() || effects.fluid || effects.contact) {
        return "pressures, membranes, sliding pairs, fluid and contact have no estimate";
    }
    return {};
}

std::string inverted(const RestState& rest, const VectorXd& jacobian) {
    const std::vector<int> material_of = material_of_elements(rest);
    for (int e = 0; e < jacobian.size(); ++e) {
        if (jacobian[e] > 0.0 || (admits_inversion(rest.materials[material_of[e]]) && std::isfinite(jacobian[e])))
            continue;
        return "tetrahedron " + std::to_string(rest.tet[e]) + " has det F = " + std::to_string(jacobian[e]);
    }
    return {};
}

void require_sizes(const Model& model, const NodalConditions& conditions, const Matrix3Xd& displacement) {
    const int count = model.mesh.node_count();
    if (displacement.cols() == count && conditions.constrained.cols() == count) return;
    throw InvalidInput("a mesh of " + std::to_string(count) + " nodes has displacements of " +
                       std::to_string(displacement.cols()) + " and conditions of " +
                       std::to_string(conditions.constrained.cols()) + "; give those of the same mesh");
}

// The corners of the internal order back to those of the mesh.
Eigen::Matrix<int, 6, Eigen::Dynamic> in_mesh_order(const Eigen::Matrix<int, 6, Eigen::Dynamic>& edges,
                                                    const std::vector<int>& tet) {
    Eigen::Matrix<int, 6, Eigen::Dynamic> result(6, edges.cols());
    for (Eigen::Index e = 0; e < edges.cols(); ++e) result.col(tet[static_cast<std::size_t>(e)]) = edges.col(e);
    return result;
}

}  // namespace

Vector3d DiscretisationError::at(const meshing::TetMesh& mesh, int tet, const Eigen::Vector4d& barycentric) const {
    Vector3d result = Vector3d::Zero();
    for (int c = 0; c < 4; ++c) result += barycentric[c] * corner.col(mesh.tets(c, tet));
    for (int k = 0; k < 6; ++k) {
        const auto [a, b] = detail::tetrahedron_edges[k];
        result += 4.0 * barycentric[a] * barycentric[b] * bubble.col(edges_of(k, tet));
    }
    return result;
}

DiscretisationEstimate discretisation_error(const Model& model, const RestStiffness& stiffness,
                                            const NodalConditions& conditions, const Matrix3Xd& displacement,
                                            const DistributedLoads& loads, const DiscretisationOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    require_sizes(model, conditions, displacement);
    if (std::string reason = unsupported(model, conditions); !reason.empty()) return {std::nullopt, std::move(reason)};
    Model with_averages = model;
    with_averages.element = Element::AveragedPressureT4;
    const RestState rest = rest_state(with_averages);
    const VectorXd jacobian = detail::element_jacobians(rest, displacement);
    if (std::string reason = inverted(rest, jacobian); !reason.empty()) return {std::nullopt, std::move(reason)};

    std::vector<bool> averaged;
    for (const Material& material : rest.materials) {
        averaged.push_back(suggested_element({{1, material}}) == Element::AveragedPressureT4);
    }
    const detail::HierarchicalSpace space = detail::hierarchical_space(rest.nodes, rest.node_count);
    const detail::HierarchicalStiffness elastic(space, rest, averaged, displacement);
    const detail::BubbleConditions bubbles =
        bubble_conditions(space, rest.volume, model.mesh, conditions, displacement, loads);
    const Enrichment K(space, elastic, bubbles, stiffness, conditions);

    Matrix3Xd residual = elastic.residual(model_pressure(model, rest, jacobian));
    residual.rightCols(space.edge_count()) += bubbles.force;
    K.constrain(residual);
    Solution found = conjugate_gradients(K, std::move(residual), options);
    if (!found.failure.empty()) return {std::nullopt, std::move(found.failure)};
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    return {DiscretisationError{found.x.leftCols(space.corner_count), found.x.rightCols(space.edge_count()), space.edge,
                                in_mesh_order(space.edge_of, rest.tet), found.iterations, time.count()},
            {}};
}

}  // namespace tissuewarp::tled
