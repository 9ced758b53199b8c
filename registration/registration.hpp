#pragma once
/// All that a program needs to prepare a patient's model, register it during the operation and use the result.

#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/field/inverse_transform.hpp"
#include "registration/gpu_warp.hpp"
#include "registration/matching/image_mask.hpp"
#include "registration/prepared/patient_io.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/record.hpp"
#include "registration/stretch/stretched_update.hpp"
#include "registration/tissues.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
