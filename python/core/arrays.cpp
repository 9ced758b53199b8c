#include "python/core/arrays.hpp"

#include "core/errors.hpp"

#include <string>

namespace tissuewarp::python {

namespace {

/// Frees a numpy array when the last matrix that shows it goes, whichever thread that is.
class ArrayOwner : public cv::MatAllocator {
public:
    cv::UMatData* hold(const py::array& array, py::object owner) const {
        auto* data = new cv::UMatData(this);
        data->data = data->origdata = static_cast<uchar*>(const_cast<void*>(array.data()));
        data->size = static_cast<std::size_t>(array.nbytes());
        data->userdata = new py::object(py::make_tuple(array, std::move(owner)));
        return data;
    }
    void deallocate(cv::UMatData* data) const override {
        if (data == nullptr) return;
        const py::gil_scoped_acquire python;
        delete static_cast<py::object*>(data->userdata);
        delete data;
    }
    // A matrix of an array that is made anew takes memory of OpenCV's own.
    cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, size_t* step, cv::AccessFlag flags,
                           cv::UMatUsageFlags usage) const override {
        return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
    }
    bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
        return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
    }
};

/// Outlives every matrix, those of objects that Python never frees too.
const ArrayOwner& array_owner() {
    static const auto* owner = new ArrayOwner;
    return *owner;
}

int depth_of(const py::dtype& type) {
    const char kind = type.kind();
    const auto bytes = type.itemsize();
    if (kind == 'u' && bytes == 1) return CV_8U;
    if (kind == 'i' && bytes == 1) return CV_8S;
    if (kind == 'u' && bytes == 2) return CV_16U;
    if (kind == 'i' && bytes == 2) return CV_16S;
    if (kind == 'i' && bytes == 4) return CV_32S;
    if (kind == 'f' && bytes == 4) return CV_32F;
    if (kind == 'f' && bytes == 8) return CV_64F;
    throw InvalidInput("voxels of the type " + std::string(py::str(py::handle(type))) +
                       " are not stored; give uint8, int8, uint16, int16, int32, float32 or float64");
}

py::dtype dtype_of(int depth) {
    static constexpr const char* names[] = {"u1", "i1", "u2", "i2", "i4", "f4", "f8"};
    return py::dtype(names[depth]);
}

}  // namespace

imaging::Volume volume_of(const py::array& array, const imaging::Geometry& grid, const py::object& owner) {
    const bool vectors = array.ndim() == 4 && array.shape(3) == 3;
    if (array.ndim() != 3 && !vectors)
        throw InvalidInput("an image has the shape (z, y, x), or (z, y, x, 3) for vectors; this array has " +
                           std::to_string(array.ndim()) + " dimensions");
    if ((array.flags() & py::array::c_style) == 0)
        throw InvalidInput("voxels lie with gaps or in another order; give numpy.ascontiguousarray(array)");
    const int sizes[3] = {static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)),
                          static_cast<int>(array.shape(2))};
    cv::Mat voxels(3, sizes, CV_MAKETYPE(depth_of(array.dtype()), vectors ? 3 : 1), const_cast<void*>(array.data()));
    voxels.u = array_owner().hold(array, owner);
    voxels.addref();
    return {grid, std::move(voxels)};
}

py::array array_of(const imaging::Volume& volume) {
    const cv::Mat& voxels = volume.voxels;
    std::vector<py::ssize_t> shape{voxels.size[0], voxels.size[1], voxels.size[2]};
    if (voxels.channels() > 1) shape.push_back(voxels.channels());
    const py::capsule owner(new cv::Mat(voxels), [](void* p) { delete static_cast<cv::Mat*>(p); });
    py::array view(dtype_of(voxels.depth()), shape, voxels.data, owner);
    view.attr("flags").attr("writeable") = false;
    return view;
}

}  // namespace tissuewarp::python
