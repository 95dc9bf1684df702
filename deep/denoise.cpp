#include "deep/denoise.h"
