#include "tests/verification/problems.hpp"
#include "tests/verification/study.hpp"
#include <cstdio>
#include <cstdlib>
#include <string>
#include <chrono>
using namespace tissuewarp::verification;
int main(int argc, char** argv) {
    std::array<int,3> L{std::atoi(argv[3]),std::atoi(argv[4]),std::atoi(argv[5])};
    Elements el = static_cast<Elements>(std::atoi(argv[2]));
    for (Law law : {Law::Iso, Law::LnJ}) {
        if (argc > 6 && law == Law::LnJ) break;
        std::string n = argv[1];
        Problem p = n=="stretch"? cube_stretch(law): n=="mild"? cube_mild_compression(law): n=="comp"?cube_compression(law): n=="shear"?cube_shear(law): n=="cook2"?cook_plane_strain(law,atof(getenv("NU"))): n=="cook3"?*cook_3d(law,atof(getenv("NU"))):n=="twist"?bar_twist(law):n=="cant"?cantilever(law):n=="ell"?ellipsoid_plain(law):n=="inc"?ellipsoid_inclusion():n=="prone"?breast(law,Gravity::Prone):n=="supine"?breast(law,Gravity::Supine):n=="block"?block_contact(law,1):half_ball_contact(law,5);
        auto t0=std::chrono::steady_clock::now();
        Study s = study(p, el, L);
        printf("%s %s nodes %d it %d minJ %.3f  %.1fs\n", p.name.c_str(), name_of(el), s.nodes[2], s.iterations[2], s.min_jacobian[2], std::chrono::duration<double>(std::chrono::steady_clock::now()-t0).count());
        for (auto& c : s.comparisons) {
            printf("  %s: %.5f %.5f %.5f  extrap %.5f (%.2f) ref %.5f ± %.5f mesh %.5f off %.5f  excess %.5f %s  maxoff %.5f\n", c.quantity.c_str(), c.coarse[0],c.middle[0],c.fine[0],c.extrapolated,c.order,c.reference[0],c.uncertain,c.mesh_error,c.off,c.excess(),c.met()?"MET":"not", c.largest_off);
        }
        fflush(stdout);
    }
}
