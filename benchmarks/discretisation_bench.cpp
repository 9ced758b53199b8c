// disc bench
#include "meshing/primitives.hpp"
#include "tled/discretisation_error.hpp"
#include "tled/reference.hpp"
#include "tled/equilibrium.hpp"
#include "tled/engine.hpp"

#include "tled/detail/hierarchical_product.hpp"
#include <chrono>
#include <cstdio>
#include <cstdlib>
using namespace tissuewarp; using namespace tissuewarp::tled;
double now(){return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();}
int main(int,char**argv){
 int n=atoi(argv[1]); double nu=atof(argv[2]);
 Model model; model.mesh=meshing::box_mesh({100,100,100},{n,n,n},0.1,7);
 model.materials[1]=neo_hookean_iso(3.0,nu); model.element=suggested_element(model.materials);
 Conditions c; 
 for(int i=0;i<model.mesh.node_count();++i){ auto X=model.mesh.nodes.col(i); if(X[2]<1e-9) c.prescribed.push_back({i,{true,true,true},Eigen::Vector3d::Zero()}); else if(X[2]>100-1e-9&&X[0]<60) c.prescribed.push_back({i,{true,true,true},Eigen::Vector3d(3,0,-8)}); }
 auto nc=nodal_conditions(c,model.mesh.node_count());
 double t0=now(); RestState rest=rest_state(model); double t1=now(); RestStiffness K(rest,nc); double t2=now();
 std::printf("tets %d nodes %d rest %.3f factor %.3f nnz %lld\n",model.mesh.tet_count(),model.mesh.node_count(),t1-t0,t2-t1,K.factor_nonzeros());
 auto engine_ptr=make_cpu_engine(rest); Engine& engine=*engine_ptr;
 auto eq=equilibrium(engine,K,nc,{.tolerance_mm=0.01});
 Eigen::Matrix3Xd u=eq.displacement;
 double t3=now(); auto z=K.solve(u); double t4=now(); std::printf("equilibrium %.3f solve %.4f\n",t3-t2,t4-t3);
 {auto space=detail::hierarchical_space(rest.nodes,rest.node_count); double t5=now();
 Model m2=model; m2.element=Element::AveragedPressureT4; RestState r2=rest_state(m2); double t6=now();
 auto T=detail::hierarchical_tissue(space,r2,{nu>0.46},u,detail::Moduli::Exact); double t7=now(); auto b=detail::bubble_blocks(T); double t8=now(); detail::HierarchicalProduct H(T);
 Eigen::Matrix3Xd x=Eigen::Matrix3Xd::Random(3,space.size()); double t9=now(); for(int k=0;k<20;++k) x=H(x)/1e3; double t10=now();
 std::printf("space %.3f rest %.3f linearise %.3f blocks %.3f multiply %.4f\n",t5-t4,t6-t5,t7-t6,t8-t7,(t10-t9)/20);}
 for(double tol:{1e-2,1e-3}){ auto e=discretisation_error(model,K,nc,u,{},{.relative_tolerance=tol,.max_iterations=3000});
 if(!e.error){std::printf("%s\n",e.reason.c_str());continue;}
 std::printf("tol %g iterations %d seconds %.3f corner max %.4f rms %.5f bubble max %.4f\n",tol,e.error->iterations,e.error->seconds,e.error->corner.colwise().norm().maxCoeff(),e.error->corner.norm()/std::sqrt(double(u.cols())),e.error->bubble.colwise().norm().maxCoeff());}
}
