#include "atmos_model/allocator.h"
